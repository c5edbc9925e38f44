//! All that a tick's successors follow from, besides what they consume: kernel, intake, and where its path comes from. The
//! lists of feed come behind it, as the background has them.

use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};

use super::log::Begun;
use super::record::{Recorder, TRIPS_MAX};
use crate::fault::FaultKind;
use crate::kernel::{Kernel, KernelState};
use crate::num::Real;
use crate::queue::{Intake, IntakeState};

/// The state between two ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<R: Real, const AXES: usize> {
    pub(super) kernel: KernelState<R, AXES>,
    pub(super) intake: IntakeState,
    pub(super) begun: Begun,
    /// What the board had found before the last tick.
    pub(super) trips: [Option<FaultKind<R>>; TRIPS_MAX],
}

impl<R: Real, const AXES: usize> Snapshot<R, AXES> {
    pub(super) fn of(
        kernel: &Kernel<R, AXES>,
        intake: &Intake<'_, R, AXES>,
        recorder: &Recorder<'_, R, AXES>,
        begun: Begun,
    ) -> Self {
        Self { kernel: kernel.state(), intake: intake.state(), begun, trips: recorder.trips() }
    }

    /// Its bytes from `offset` on, as many as `out` has room for; how many, and whether these are the last.
    pub(super) fn piece(&self, offset: usize, out: &mut [u8]) -> (usize, bool) {
        let length = out.len();
        let window = Window { out, skip: offset, count: 0 };
        // A window never fails.
        let count = postcard::serialize_with_flavor(self, window).unwrap_or_default();
        (count.min(length), count <= length)
    }
}

/// Some of the bytes that are written: those behind the first ones, as many as there is room for.
struct Window<'a> {
    out: &'a mut [u8],
    skip: usize,
    /// Bytes behind the skipped ones.
    count: usize,
}

impl Flavor for Window<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        if self.skip > 0 {
            self.skip -= 1;
            return Ok(());
        }
        if let Some(place) = self.out.get_mut(self.count) {
            *place = byte;
        }
        self.count += 1;
        Ok(())
    }

    fn finalize(self) -> postcard::Result<usize> {
        Ok(self.count)
    }
}
