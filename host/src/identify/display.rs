//! The result in words: one line per parameter, with its interval and what it was determined from.

use std::fmt::{Display, Formatter, Result};

use super::{AxisParametersFound, BedEstimate, Estimate, Figures, Identification, RunMatch};

impl Display for Identification {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}", self.parameters)?;
        let each = self.misfit_per_reading;
        if self.is_met() {
            writeln!(
                f,
                "\nWhat is left has {each:.2} times the square of the readings' errors: the model explains the runs."
            )?;
        } else {
            writeln!(
                f,
                "\nWhat is left has {each:.1} times the square of the readings' errors: the axis has something that the \
                 model lacks.\nIntervals are as wide as that allows."
            )?;
        }
        writeln!(f, "\nModel against recording, rms error of each run:")?;
        for (index, RunMatch { error_mm_rms, travel_mm }) in self.runs.iter().enumerate() {
            let number = index + 1;
            writeln!(f, "  run {number:<3} {:>9.3} µm of {travel_mm:.3} mm travel", error_mm_rms * 1e3)?;
        }
        write!(f, "\n{}", self.figures)
    }
}

/// A parameter in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Described {
    /// What it is.
    pub name: &'static str,
    /// Its value with interval and unit, or that it is not determined.
    pub found: String,
    /// What it was determined from, or would show in.
    pub why: String,
}

impl Display for AxisParametersFound {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        writeln!(f, "Axis with its drive (per unit of the inertia moved), ± 95 % confidence:")?;
        for Described { name, found, why } in self.described() {
            let line = format!("  {name:<22} {found:<26} {why}");
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

impl AxisParametersFound {
    /// All parameters in words.
    #[must_use]
    pub fn described(&self) -> Vec<Described> {
        let ms = |estimate: Estimate| estimate.times(1e3);
        let mut all = vec![
            described("command gain", self.command_gain, "", "travel of all runs"),
            offset(self.command_offset_mm_s),
            described("velocity gain Kv", self.velocity_gain_per_s, "1/s", "response to small steps"),
            described(
                "integral time Ti",
                ms(self.integral_time_s),
                "ms",
                "overshoot, recovery from friction",
            ),
            described("dead time τ", ms(self.dead_time_s), "ms", "first motion after a command"),
            described("current loop lag Tc", ms(self.current_lag_s), "ms", "how motion sets in"),
            described("command filter Tf", ms(self.command_filter_s), "ms", "the first bend of a motion"),
            described("total delay τ+Tf+Tc+T/2", ms(self.total_delay_s), "ms", "all runs"),
            described(
                "acceleration limit",
                self.accel_limit_mm_s2.times(1e-3),
                "m/s²",
                "runs that saturate the drive",
            ),
            described("Coulomb friction", self.coulomb_friction_mm_s2, "mm/s²", "reversals"),
            described("viscous friction", self.viscous_friction_per_s, "1/s", "fast against slow motion"),
        ];
        match &self.bed {
            None => all.push(Described {
                name: "machine bed",
                found: "none: a rigid bed explains the recordings as well".to_owned(),
                why: String::new(),
            }),
            Some(bed) => all.extend(of_bed(bed)),
        }
        all
    }
}

fn of_bed(bed: &BedEstimate) -> [Described; 4] {
    [
        described("bed frequency", bed.frequency_hz, "Hz", "ringing after steps, harmonic motion"),
        described("bed damping", bed.damping_ratio.times(100.0), "%", "decay of that ringing"),
        described("bed mass ratio", bed.mass_ratio, "", "size of that ringing"),
        Described {
            name: "machine resonance",
            found: format!("{:.2} Hz", bed.resonance_hz()),
            why: "from the bed".to_owned(),
        },
    ]
}

/// One parameter.
fn described(name: &'static str, estimate: Estimate, unit: &str, from: &str) -> Described {
    let Estimate { value, half_width_95 } = estimate;
    let digits = decimals(half_width_95);
    if estimate.is_determined() {
        let found = format!("{value:.digits$} ± {half_width_95:.digits$} {unit}");
        return Described { name, found: found.trim_end().to_owned(), why: format!("from {from}") };
    }
    let upper = estimate.upper();
    let is_bound = upper.is_finite() && upper < 3.0 * value.abs().max(half_width_95);
    let bound = if is_bound { format!(", ≤ {upper:.digits$} {unit}") } else { String::new() };
    Described { name, found: format!("not determined{bound}"), why: format!("would show in: {from}") }
}

/// The one quantity whose likeliest value is 0.
fn offset(estimate: Estimate) -> Described {
    let Estimate { value, half_width_95 } = estimate;
    let digits = decimals(half_width_95);
    Described {
        name: "command offset",
        found: format!("{value:.digits$} ± {half_width_95:.digits$} mm/s"),
        why: "from drift at rest and in slow motion".to_owned(),
    }
}

/// Decimals that show two digits of the interval.
fn decimals(half_width: f64) -> usize {
    if half_width > 0.0 && half_width.is_finite() {
        // The cast saturates.
        (1.0 - libm::log10(half_width).floor()).clamp(0.0, 6.0) as usize
    } else {
        3
    }
}

impl Display for Figures {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        writeln!(f, "Read off the recordings (encoder step {} µm):", round_micro(self.resolution_mm))?;
        for step in &self.steps {
            write!(
                f,
                "  step to {:>9.3} mm/s: delay {:.2} ms, time constant {:.2} ms, overshoot {:.1} %, settled ",
                step.feed_mm_s,
                step.delay_s * 1e3,
                step.time_constant_s * 1e3,
                step.overshoot * 100.0,
            )?;
            match step.settling_s {
                Some(time_s) => write!(f, "after {:.0} ms", time_s * 1e3)?,
                None => write!(f, "beyond what was recorded or the encoder resolves")?,
            }
            writeln!(f, ", peak {:.2} m/s²", step.peak_accel_mm_s2 * 1e-3)?;
        }
        for point in &self.harmonics {
            writeln!(
                f,
                "  harmonic {:>6.2} Hz at {:>7.2} mm/s: gain {:.3}, delay {:.2} ms",
                point.frequency_hz,
                point.amplitude_mm_s,
                point.gain,
                point.delay_s * 1e3
            )?;
        }
        for point in &self.bandwidths {
            let (hz, amplitude) = (point.frequency_hz, point.amplitude_mm_s);
            writeln!(f, "  −3 dB at {hz:.1} Hz for an amplitude of {amplitude:.2} mm/s")?;
        }
        writeln!(f, "  greatest acceleration over 5 ms: {:.2} m/s²", self.sustained_accel_mm_s2 * 1e-3)
    }
}

/// The residual in µm, without the rounding of the readings.
fn round_micro(mm: f64) -> f64 {
    (mm * 1e3 * 1e6).round() / 1e6
}
