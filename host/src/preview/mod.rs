//! Pictures: the lit sheet, material balls, passes, separations.
