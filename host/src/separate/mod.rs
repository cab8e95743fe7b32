//! A sheet as the fewest ordered one-bit passes.
