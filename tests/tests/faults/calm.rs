//! Nothing breaks: no guard may find anything, whatever the noise and the tuning.

use hal_sim::EncoderNoise;
use motion_host::machine::Machine;
use motion_kernel::axis::{BedInverse, DriveInverse, Feedforward, Gains};
use motion_kernel::num::{Fixed, Real};

use super::machine::{Next, random_plan, run};
use super::setting;
use motion_tests::random::Random;

/// The reference machine, tuned: the inverse of its drives, early feedforward.
fn tuned() -> Machine {
    let mut machine = Machine::reference();
    for axis in &mut machine.axes {
        let drive = axis.drive;
        axis.gains = Gains { kp_per_s: 120.0, ki_per_s2: 0.0, kd: 0.0 };
        axis.feedforward = Feedforward {
            velocity: 1.0,
            lead_s: drive.dead_time_s + machine.tick_s / 2.0,
            drive: Some(DriveInverse {
                velocity_gain_per_s: drive.velocity_gain_per_s,
                integral_time_s: drive.integral_time_s,
                current_lag_s: drive.current_lag_s,
                viscous_friction_per_s: drive.viscous_friction_per_s,
                coulomb_friction_mm_s2: drive.coulomb_friction_mm_s2,
                reversal_mm_s: 0.5,
                bed: drive.bed.map(|bed| BedInverse {
                    frequency_hz: bed.frequency_hz,
                    damping_ratio: bed.damping_ratio,
                    mass_ratio: bed.mass_ratio,
                }),
            }),
            ..Feedforward::default()
        };
    }
    machine
}

/// Any wiring, resolution and noise.
fn any(random: &mut Random) -> Machine {
    let mut machine = if random.chance(0.5) { tuned() } else { Machine::reference() };
    for axis in &mut machine.axes {
        axis.mm_per_count = random.log(2e-5, 5e-3);
        let amplitude_counts = random.below(5) as u16;
        axis.noise = (amplitude_counts > 0).then_some(EncoderNoise { amplitude_counts, seed: random.bits() });
        axis.mm_s_at_10_v *= random.sign() * random.between(1.0, 1.5);
        // A trim that is off commands motion where there is none: by less than moving_mm_s.
        axis.output_offset_v = random.between(-0.05, 0.05);
        // Feedforward that is off, within what the guards allow for.
        axis.feedforward.velocity = random.between(0.9, 1.0);
    }
    machine
}

fn calm<R: Real>(stream: u64) {
    let (first, most) = (setting("MOTION_TEST_SEED", 1), setting("MOTION_TEST_TICKS", 150_000));
    let (mut ticks, mut programs, mut seed) = (0, 0, first ^ stream << 32);
    while ticks < most {
        seed += 1;
        let mut random = Random::new(seed);
        let machine = any(&mut random);
        let plan = random_plan(&mut random, &machine, 20_000.0);
        ticks += run::<R>(&plan, &machine, &mut |_, _, _, seen| {
            if let Some(fault) = seen.and_then(|seen| seen.trace.fault) {
                panic!("seed {seed}: {fault:?} of {machine:?}");
            }
            Next::GoOn
        });
        programs += 1;
    }
    println!("{ticks} ticks of {programs} programs");
}

#[test]
fn no_false_alarm() {
    calm::<f32>(0);
}

#[test]
fn no_false_alarm_in_fixed_point() {
    calm::<Fixed>(1);
}
