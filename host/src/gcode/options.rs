//! What a program is read with.

use std::path::PathBuf;

use super::axis::Axes;
use super::parameter_file::ParameterFile;
use super::probe::Probe;
use super::tool::ToolTable;

/// What a program is read with: switches of the operator, files beside the program, and bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The axes of the machine; X, Y and Z by default. Words of others are refused.
    pub axes: Axes,
    /// Lines that begin with `/` are left out; as in LinuxCNC, on by default.
    pub block_delete: bool,
    /// M1 stops; on by default.
    pub optional_stop: bool,
    /// Folders with subroutines, `name.ngc` each; the first that has the file counts.
    pub subroutines: Vec<PathBuf>,
    /// Parameters to start with.
    pub parameters: ParameterFile,
    /// The tools there are; without a table, the length of every tool is 0.
    pub tools: Option<ToolTable>,
    /// The subroutine that M6 calls, lower case; without it M6 is a stop for the operator.
    pub change_subroutine: Option<String>,
    /// Radius of every tool where there is no table \[mm\]; 0: not known, and G41 and G42 are refused.
    pub tool_radius_mm: f64,
    /// What probing moves touch; without it they are refused.
    pub probe: Option<Probe>,
    /// Most lines to execute, so that endless loops end; 100 million by default.
    pub lines_max: u64,
    /// Most steps, and most messages, that the program may have; 20 million by default, some 6 GB.
    pub steps_max: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            axes: Axes::XYZ,
            block_delete: true,
            optional_stop: true,
            subroutines: Vec::new(),
            parameters: ParameterFile::default(),
            tools: None,
            change_subroutine: None,
            tool_radius_mm: 0.0,
            probe: None,
            lines_max: 100_000_000,
            steps_max: 20_000_000,
        }
    }
}
