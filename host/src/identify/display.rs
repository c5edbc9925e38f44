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

impl Display for AxisParametersFound {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        writeln!(f, "Axis with its drive (per unit of the inertia moved), ± 95 % confidence:")?;
        line(f, "command gain", self.command_gain, "", "travel of all runs")?;
        offset(f, self.command_offset_mm_s)?;
        line(f, "velocity gain Kv", self.velocity_gain_per_s, "1/s", "response to small steps")?;
        line(
            f,
            "integral time Ti",
            self.integral_time_s.times(1e3),
            "ms",
            "overshoot, recovery from friction",
        )?;
        line(f, "dead time τ", self.dead_time_s.times(1e3), "ms", "first motion after a command")?;
        line(f, "current loop lag Tc", self.current_lag_s.times(1e3), "ms", "how motion sets in")?;
        line(f, "command filter Tf", self.command_filter_s.times(1e3), "ms", "the first bend of a motion")?;
        line(f, "total delay τ+Tf+Tc+T/2", self.total_delay_s.times(1e3), "ms", "all runs")?;
        line(
            f,
            "acceleration limit",
            self.accel_limit_mm_s2.times(1e-3),
            "m/s²",
            "runs that saturate the drive",
        )?;
        line(f, "Coulomb friction", self.coulomb_friction_mm_s2, "mm/s²", "reversals")?;
        line(f, "viscous friction", self.viscous_friction_per_s, "1/s", "fast against slow motion")?;
        match &self.bed {
            None => writeln!(f, "  {:<22} none: a rigid bed explains the recordings as well", "machine bed"),
            Some(bed) => bed_lines(f, bed),
        }
    }
}

fn bed_lines(f: &mut Formatter<'_>, bed: &BedEstimate) -> Result {
    line(f, "bed frequency", bed.frequency_hz, "Hz", "ringing after steps, harmonic motion")?;
    line(f, "bed damping", bed.damping_ratio.times(100.0), "%", "decay of that ringing")?;
    line(f, "bed mass ratio", bed.mass_ratio, "", "size of that ringing")?;
    writeln!(f, "  {:<22} {:>12.2} Hz", "machine resonance", bed.resonance_hz())
}

/// One parameter.
fn line(f: &mut Formatter<'_>, name: &str, estimate: Estimate, unit: &str, from: &str) -> Result {
    if estimate.is_determined() {
        let Estimate { value, half_width_95 } = estimate;
        let digits = decimals(half_width_95);
        let value = format!("{value:.digits$} ± {half_width_95:.digits$} {unit}");
        return writeln!(f, "  {name:<22} {value:<26} from {from}");
    }
    let upper = estimate.upper();
    if upper.is_finite() && upper < 3.0 * estimate.value.abs().max(estimate.half_width_95) {
        let digits = decimals(estimate.half_width_95);
        let value = format!("not determined, ≤ {upper:.digits$} {unit}");
        writeln!(f, "  {name:<22} {value:<26} would show in: {from}")
    } else {
        writeln!(f, "  {name:<22} {:<26} would show in: {from}", "not determined")
    }
}

/// The one quantity whose likeliest value is 0.
fn offset(f: &mut Formatter<'_>, estimate: Estimate) -> Result {
    let Estimate { value, half_width_95 } = estimate;
    let digits = decimals(half_width_95);
    let value = format!("{value:.digits$} ± {half_width_95:.digits$} mm/s");
    writeln!(f, "  {:<22} {value:<26} from drift at rest and in slow motion", "command offset")
}

/// Decimals that show two digits of the interval.
fn decimals(half_width: f64) -> usize {
    if half_width > 0.0 && half_width.is_finite() {
        // The cast saturates.
        (1.0 - half_width.log10().floor()).clamp(0.0, 6.0) as usize
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
