//! Sample documents made by the program itself.
