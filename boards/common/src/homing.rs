//! Homing that a PC asks for over the link.
//!
//! Consumes the machine's figures and the axes that are asked for; has them homed, one after the other, by the kernel's
//! [`Homing`]; keeps what was found. [`Linked`](crate::Linked) does what is asked for here: it has streams and kernel.

use motion_kernel::homing::{Homed, Homing, HomingFigures, HomingStage};
use motion_kernel::law::Pulse;
use motion_kernel::link::{HomingFailure, HomingProgress};

/// The axes' homing.
pub(crate) struct BoardHoming<const AXES: usize> {
    figures: HomingFigures<AXES>,
    pulse: Pulse,
    tick_s: f64,
    /// Axes that are still to be homed after the one under way, the lowest bit is the first one's.
    left: u16,
    /// The axis under way. What it was aborted for is told once the machine is at rest.
    axis: usize,
    stage: Stage,
    pub(crate) progress: HomingProgress,
    /// The reference of every axis that is homed.
    pub(crate) homed: [Option<Homed>; AXES],
}

// There is no heap to put homing on.
#[allow(clippy::large_enum_variant)]
enum Stage {
    Nothing,
    /// Waits for rest.
    Asked,
    Runs(Homing),
    /// Comes to rest.
    Ends(HomingFailure),
}

impl<const AXES: usize> BoardHoming<AXES> {
    /// Of a machine whose axes are not homed.
    pub(crate) fn new(figures: &HomingFigures<AXES>, pulse: Pulse, tick_s: f64) -> Self {
        Self {
            figures: *figures,
            pulse,
            tick_s,
            left: 0,
            axis: 0,
            stage: Stage::Nothing,
            progress: HomingProgress::None,
            homed: [None; AXES],
        }
    }

    /// Whether something is asked for or under way.
    pub(crate) fn is_under_way(&self) -> bool {
        !matches!(self.stage, Stage::Nothing)
    }

    /// The homing under way, and its axis. While there is one, it decides about the streams.
    pub(crate) fn running(&mut self) -> Option<(usize, &mut Homing)> {
        match &mut self.stage {
            Stage::Runs(homing) => Some((self.axis, homing)),
            _ => None,
        }
    }

    /// Whether it waits for rest to begin.
    pub(crate) fn is_asked(&self) -> bool {
        matches!(self.stage, Stage::Asked)
    }

    /// Has `axes` homed, the lowest bit is the first one's. All of them have to have figures.
    pub(crate) fn ask(&mut self, axes: u16) {
        self.left = axes;
        let figures = |axis: usize| self.figures.axes.get(axis).is_some_and(Option::is_some);
        let wanted = |axis: &usize| axes & (1 << axis) != 0;
        let lacking = (0..u16::BITS as usize).filter(wanted).find(|&axis| !figures(axis));
        match lacking.or((axes == 0).then_some(0)) {
            Some(axis) => {
                self.axis = axis;
                self.fail(HomingFailure::NoSettings);
            }
            None => {
                self.axis = axes.trailing_zeros() as usize;
                self.stage = Stage::Asked;
                self.tell();
            }
        }
    }

    /// The machine is at rest: begins with the next axis. False if there is none any more.
    pub(crate) fn begin_next(&mut self) -> bool {
        let axis = self.left.trailing_zeros() as usize;
        let Some(Some(figures)) = self.figures.axes.get(axis) else {
            (self.stage, self.progress) = (Stage::Nothing, HomingProgress::Done);
            return false;
        };
        self.left &= !(1 << axis);
        if let Some(homed) = self.homed.get_mut(axis) {
            *homed = None;
        }
        (self.axis, self.stage) = (axis, Stage::Runs(figures.start(axis, self.pulse, self.tick_s)));
        self.tell();
        true
    }

    /// The axis under way is homed.
    pub(crate) fn found(&mut self, homed: Homed) {
        if let Some(place) = self.homed.get_mut(self.axis) {
            *place = Some(homed);
        }
    }

    /// Tells the axis under way and what it does.
    pub(crate) fn tell(&mut self) {
        let stage = match &self.stage {
            Stage::Runs(homing) => homing.stage(),
            _ => HomingStage::Search,
        };
        self.progress = HomingProgress::UnderWay { axis: self.axis as u16, stage };
    }

    /// Ends as soon as the machine is at rest; false if nothing is under way.
    pub(crate) fn end(&mut self, failure: HomingFailure) -> bool {
        let is_first = matches!(self.stage, Stage::Asked | Stage::Runs(_));
        if is_first {
            self.stage = Stage::Ends(failure);
        }
        is_first
    }

    /// Was asked for `axes`, and to end it, before it began.
    pub(crate) fn give_up(&mut self, axes: u16, failure: HomingFailure) {
        if !self.is_under_way() {
            self.axis = (axes.trailing_zeros() as usize).min(AXES.saturating_sub(1));
            self.fail(failure);
        }
    }

    /// The machine is at rest after an abort; whether that was what homing waited for.
    pub(crate) fn rests(&mut self) -> bool {
        let Stage::Ends(failure) = self.stage else { return false };
        self.fail(failure);
        true
    }

    /// Has ended.
    pub(crate) fn fail(&mut self, failure: HomingFailure) {
        self.stage = Stage::Nothing;
        self.progress = HomingProgress::Failed { axis: self.axis as u16, failure };
    }
}
