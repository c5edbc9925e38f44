//! What the integration tests share across test programs.

pub mod cycles;
pub mod figures;
pub mod fuzz;
