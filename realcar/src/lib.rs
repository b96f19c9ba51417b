//! Cars whose effects are withheld from the diagnosis.
