//! The encoders' counters, which the model turns.

use motion_kernel::hal::CountExtender;
use motion_kernel::units::Counts;
use nucleo_f446re::machine::AXES;

use super::model;

/// There is no index input for this axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoIndex;

/// The extension of three counters: as wide as the board's.
pub(crate) struct Encoders {
    x: CountExtender<u32>,
    y: CountExtender<u32>,
    z: CountExtender<u16>,
}

impl Encoders {
    /// The encoders, counting from 0.
    pub(crate) fn new() -> Self {
        let [x, y, z] = model::counters();
        Self { x: CountExtender::new(x), y: CountExtender::new(y), z: CountExtender::new(z as u16) }
    }

    /// Forgets the index pulse of an axis.
    pub(crate) fn arm_index(&mut self, _: usize) -> Result<(), NoIndex> {
        Err(NoIndex)
    }

    /// The count of an axis at the last index pulse.
    pub(crate) fn index(&self, _: usize) -> Result<Option<Counts>, NoIndex> {
        Err(NoIndex)
    }

    /// All counts, read at once.
    pub(crate) fn latch(&mut self) -> [Counts; AXES] {
        let [x, y, z] = model::counters();
        [self.x.extend(x), self.y.extend(y), self.z.extend(z as u16)]
    }
}
