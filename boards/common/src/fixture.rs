//! The NUCLEO's board parameters and program, and ideal drives, for the tests of this crate.

use core::convert::Infallible;

use hal_sim::SimHomes;
use motion_kernel::hal::{
    BoardOutputs, DriveEnable, Encoder, IndexLatch, Inputs, MachineInputs, OutputState, Outputs,
    VelocityChannel,
};
use motion_kernel::link::{Build, Identity};
use motion_kernel::live::Leads;
use motion_kernel::program::FORMAT;
use motion_kernel::units::{Counts, DacCode, Position};

use crate::parameters::BoardParameters;

pub(crate) const AXES: usize = 3;

pub(crate) const BOARD: BoardParameters = BoardParameters {
    tick_hz: 2000,
    cycles_hz: 168_000_000,
    counts_per_s_max: 6_000_000,
    leads: Leads { stop_ticks: 3, plan_ticks: 8 },
    outputs: BoardOutputs::FixedSpeed,
};

pub(crate) const TICK_S: f64 = 0.0005;

/// Ticks of a long poll of the background: 33 ms. Only some plans for another override or after a hold take longer.
pub(crate) const POLL_TICKS_MAX: u32 = 66;

/// The stringer, 2.320 s long.
pub(crate) const PROGRAM: &[u8] = include_bytes!("../program/stringer.bin");

pub(crate) type Machine<'a> = crate::machine::Machine<'a, f32, AXES>;

pub(crate) fn machine() -> Machine<'static> {
    Machine::new(PROGRAM, &BOARD).expect("suits")
}

/// Of a board on the link, with room for so many items.
pub(crate) fn identity(items: usize) -> Identity {
    Identity {
        build: Build::THIS,
        format: FORMAT.into(),
        axes: AXES as u16,
        is_fixed_point: false,
        tick_s: TICK_S,
        items: items as u16,
        outputs: BOARD.outputs,
        machine: machine().program.machine_checksum(),
    }
}

/// Where the stringer ends, as `motion compile` prints it.
pub(crate) fn end() -> [Position; AXES] {
    [102.045_923_136, 0.0, 0.0].map(|mm| Position::from_mm(mm).expect("in range"))
}

/// Drives without inertia: a velocity is there in the tick that asks for it.
pub(crate) struct IdealDrives {
    pub(crate) counts: [f64; AXES],
    counts_per_code: [f64; AXES],
    mm_per_count: [f64; AXES],
    /// Home switches, and a latch for each axis that has an index.
    pub(crate) homes: SimHomes<AXES>,
    /// What the first axis' home switch says, wherever the axis is.
    pub(crate) contact: Option<bool>,
    pub(crate) is_enabled: bool,
    pub(crate) now: u32,
    /// Ticks in which outputs were switched.
    pub(crate) switched: Vec<(u32, OutputState)>,
}

impl Outputs for IdealDrives {
    fn switch(&mut self, to: &OutputState) {
        self.switched.push((self.now, *to));
    }
}

impl Encoder<AXES> for IdealDrives {
    type Error = Infallible;
    fn latch(&mut self) -> Result<[Counts; AXES], Infallible> {
        let counts = self.counts.map(|counts| Counts(counts.round() as i64));
        let position_mm = |axis: usize| Some(counts[axis].0 as f64 * self.mm_per_count[axis]);
        self.homes.advance(position_mm, counts);
        Ok(counts)
    }
}

/// There is no index latch.
#[derive(Debug)]
pub(crate) struct NoIndex;

impl IndexLatch for IdealDrives {
    type Error = NoIndex;
    fn arm(&mut self, axis: usize) -> Result<(), NoIndex> {
        self.homes.get_mut(axis).filter(|home| home.has_index()).ok_or(NoIndex)?.arm();
        Ok(())
    }
    fn latched(&mut self, axis: usize) -> Result<Option<Counts>, NoIndex> {
        let Ok(latched) = self.homes.latched(axis);
        Ok(latched)
    }
}

impl Inputs<AXES> for IdealDrives {
    type Error = Infallible;
    fn read_inputs(&mut self) -> Result<MachineInputs<AXES>, Infallible> {
        let mut inputs = self.homes.with_switches(MachineInputs::HEALTHY);
        if let Some(is_closed) = self.contact {
            inputs.axes[0] = inputs.axes[0].with_home(is_closed);
        }
        Ok(inputs)
    }
}

impl VelocityChannel<AXES> for IdealDrives {
    type Error = Infallible;
    fn write(&mut self, codes: &[DacCode; AXES]) -> Result<(), Infallible> {
        if self.is_enabled {
            for ((counts, per_code), DacCode(code)) in
                self.counts.iter_mut().zip(self.counts_per_code).zip(codes)
            {
                *counts += per_code * f64::from(*code);
            }
        }
        Ok(())
    }
}

impl DriveEnable<AXES> for IdealDrives {
    type Error = Infallible;
    fn set_enabled(&mut self, enabled: bool) -> Result<(), Infallible> {
        self.is_enabled = enabled;
        Ok(())
    }
}

impl IdealDrives {
    pub(crate) fn new() -> Self {
        let counts_per_code = machine().header().axes.map(|axis| {
            let mm_s_per_code = axis.mm_s_at_10_v / f64::from(DacCode::from_volts(10.0_f64).0);
            mm_s_per_code * BOARD.tick_s() / axis.mm_per_count
        });
        Self {
            counts: [0.0; AXES],
            counts_per_code,
            mm_per_count: machine().header().axes.map(|axis| axis.mm_per_count),
            homes: SimHomes::NONE,
            contact: None,
            is_enabled: false,
            now: 0,
            switched: Vec::new(),
        }
    }
}

/// Knuth's generator of full period; its upper bits. What tests of hosts draw from needs the standard library.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, count: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % count
    }
}
