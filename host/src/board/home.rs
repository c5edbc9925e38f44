//! Homing of a machine on a board: one axis after the other, each to its reference.
//!
//! Consumes the axes that are wanted, those of [`Homes`](crate::simulate::home::Homes); produces what the board found. The board does it by itself, with its own inputs, and ends
//! it at rest where nothing comes from here for the dead man's time.

use std::sync::Arc;
use std::time::Duration;

use motion_kernel::homing::HomingStage;
use motion_kernel::link::{HomingProgress, Status};

use super::connection::{Connection, Heard};
use super::error::BoardError;
use super::job::Job;
use super::sender::{Permissions, Sender, Step};
use crate::machine::Machine;
use crate::simulate::home::HomedAxis;

/// Homing of a machine with `N` places on a board of `M` axes.
pub struct OnBoardHoming<'a, const N: usize, const M: usize> {
    /// The machine.
    pub machine: &'a Machine<N>,
    /// A job of the machine without items.
    pub job: Arc<Job<M>>,
    /// What may be done for it.
    pub may: Permissions,
    /// After so long a silence the board ends it \[ms\], above 0.
    pub dead_man_ms: u16,
}

impl<const N: usize, const M: usize> OnBoardHoming<'_, N, M> {
    /// Homes `axes`, the lowest bit is the first one's, into `homed`, and waits until the machine stands. It is given up as soon as
    /// `is_given_up`; whether it was. What an axis begins with is told to `on_stage`. Times are those of what the board tells,
    /// some fifty times a second.
    ///
    /// # Errors
    /// The board is refused, in a fault or lost, or an axis is not homed.
    pub fn home(
        &self,
        axes: u16,
        connection: &mut Connection<M>,
        homed: &mut Vec<HomedAxis>,
        is_given_up: &mut dyn FnMut() -> bool,
        on_stage: &mut dyn FnMut(&str, HomingStage),
    ) -> Result<bool, BoardError> {
        let mut sender = Sender::new(Arc::clone(&self.job), self.machine.axis_names(), self.may)
            .homes(axes, self.dead_man_ms);
        let (mut begin, mut stage) = (None::<Status<M>>, None);
        // Axes that are still to be found.
        let mut left = axes;
        loop {
            let mut heard = Vec::new();
            connection.step(Duration::from_millis(2), &mut |one| heard.push(one));
            for one in &heard {
                sender.hear(one)?;
                if let Heard::Lost(cause) = one {
                    let told = format!("{cause}; the board comes to rest by itself");
                    return Err(BoardError::Wire(std::io::Error::other(told)));
                }
            }
            if sender.step() == Step::Homes
                && let Some(status) = connection.status().copied()
            {
                let first = *begin.get_or_insert(status);
                let under_way = match status.homing {
                    HomingProgress::UnderWay { axis, stage } => Some((axis, stage)),
                    _ => None,
                };
                if let Some((axis, now)) = under_way.filter(|_| under_way != stage) {
                    stage = under_way;
                    on_stage(&self.machine.axes[usize::from(axis)].name, now);
                }
                let axis = left.trailing_zeros() as usize;
                let is_next = under_way.is_none_or(|(now, _)| usize::from(now) != axis);
                let has_begun = !matches!(status.homing, HomingProgress::None);
                if let (true, true, Some(Some(found))) = (is_next, has_begun, status.homed.get(axis)) {
                    left &= !(1 << axis);
                    let of = &self.machine.axes[axis];
                    homed.push(HomedAxis {
                        name: of.name.clone(),
                        homed: *found,
                        // They wrap.
                        ticks: u64::from(status.tick.wrapping_sub(first.tick)),
                        unit: of.unit(),
                        position_mm: status.actual[axis].to_mm(),
                        true_mm: None,
                    });
                    begin = Some(status);
                    continue;
                }
            }
            // What the board has before the greeting is not this one's to give up.
            if !matches!(sender.step(), Step::Greets | Step::Aborts) && is_given_up() {
                sender.abort(connection);
            }
            match sender.advance(connection)? {
                Step::Done => return Ok(false),
                Step::Aborted => return Ok(true),
                _ => {}
            }
        }
    }
}
