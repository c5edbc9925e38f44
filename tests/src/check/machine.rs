//! Random machines around the reference one.

use motion_host::machine::Machine;
use motion_kernel::law::Pulse;

use crate::PULSES;
use crate::random::Random;

/// The reference machine with each law.
pub fn references() -> [Machine; 2] {
    PULSES.map(|pulse| {
        let mut machine = Machine::reference();
        machine.path.pulse = pulse;
        machine
    })
}

/// One law or the other, as often. A bit decides of the number that is drawn next, and stays there: what is
/// drawn next is a quantity, which leaves that bit aside. So a seed's machine and program are the same
/// whatever its law.
pub fn pulse(random: &Random) -> Pulse {
    if random.clone().bits() & 1 == 0 { Pulse::Sin2 } else { Pulse::Plateau }
}

/// Any limits, tick and law; its drives need not keep up.
pub fn any(random: &mut Random) -> Machine {
    let mut machine = Machine::reference();
    machine.path.pulse = pulse(random);
    machine.tick_s = random.log(0.000_25, 0.002);
    let accel = random.log(50.0, 2e4);
    let jerk = accel * random.log(3.0, 300.0);
    let snap = jerk * random.log(10.0, 1000.0);
    let path = &mut machine.path;
    path.feed_mm_s = random.log(10.0, 2000.0);
    (path.accel_mm_s2, path.jerk_mm_s3, path.snap_mm_s4) = (accel, jerk, snap);
    path.junction_angle_rad = if random.chance(0.03) { 0.0 } else { random.log(1e-3, 5.0).to_radians() };
    path.accel_step_mm_s2 = accel * random.log(0.1, 2.0);
    let feed_mm_s = path.feed_mm_s;
    for axis in &mut machine.axes {
        // Some axes are slower than the path, some don't matter.
        axis.feed_mm_s = feed_mm_s * random.log(0.3, 2.0);
        axis.accel_mm_s2 = accel * random.log(0.3, 2.0);
        axis.jerk_mm_s3 = jerk * random.log(0.3, 2.0);
        axis.snap_mm_s4 = snap * random.log(0.3, 2.0);
    }
    machine
}

/// Limits that the reference machine's drives keep up with, with either law.
pub fn gentle(random: &mut Random) -> Machine {
    let mut machine = Machine::reference();
    machine.path.pulse = pulse(random);
    let share = random.between(0.3, 1.0);
    machine.path.feed_mm_s *= share;
    machine.path.accel_mm_s2 *= share;
    machine.path.jerk_mm_s3 *= share;
    machine.path.snap_mm_s4 *= share;
    machine.path.accel_step_mm_s2 *= 0.5;
    machine
}
