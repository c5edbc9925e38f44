//! What the integration tests share across test programs.

pub mod figures;
