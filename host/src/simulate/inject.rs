//! Faults of a run: what breaks before given ticks.
//!
//! As text `TICK:FAULT,TICK:FAULT,…`, in the order of their ticks; a fault is `NAME=AXIS`, with `:VALUE`
//! where one belongs to it, or `emergency-stop`.

use std::str::FromStr;

use hal_sim::Injection;

use crate::machine::Machine;

/// Every fault that can be injected, as it is written; and what it does.
pub const INJECTIONS: [(&str, &str); 10] = [
    ("encoder-lost=AXIS", "the encoder's counts stay what they are"),
    ("encoder-jump=AXIS:COUNTS", "the encoder counts so many that were none"),
    ("encoder-reversed=AXIS", "the encoder counts the other way"),
    ("drive-reversed=AXIS", "the drive turns the other way"),
    ("overload=AXIS:ACCELERATION", "the drive has that much acceleration left, in mm/s² or °/s²"),
    ("drive-not-ready=AXIS", "the drive's ready line drops"),
    ("drive-fault=AXIS", "the drive's fault line rises"),
    ("limit-low=AXIS:POSITION", "there is a limit switch up to that position, in mm or °"),
    ("limit-high=AXIS:POSITION", "there is a limit switch from that position on, in mm or °"),
    ("emergency-stop", "the emergency stop opens"),
];

/// What breaks.
#[derive(Clone, Debug, PartialEq)]
enum Broken {
    /// Something of the axis with that name.
    Axis(String, Injection),
    EmergencyStop,
}

/// What breaks when, in the order of their ticks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Injections(Vec<(u64, Broken)>);

/// Why a text does not say what breaks. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InjectionError {
    /// A part has no colon or no tick before it.
    #[error("found `{0}`, expected TICK:FAULT such as 2000:encoder-lost=X")]
    Tick(String),
    /// A fault is not known, or not written as it has to be.
    #[error("found the fault `{0}`, expected {expected}", expected = expected())]
    Fault(String),
    /// A tick comes before the one in front of it.
    #[error("found tick {0} behind tick {1}, expected ticks in their order")]
    Order(u64, u64),
    /// The machine has no axis of that name.
    #[error("found the axis `{0}`, expected one of {1}")]
    Axis(String, String),
}

fn expected() -> String {
    let [all @ .., last] = INJECTIONS.map(|(name, _)| name);
    format!("{} or {last}", all.join(", "))
}

impl Injections {
    /// What breaks of `machine`, in the order of time.
    ///
    /// # Errors
    /// The first axis that it has not.
    pub(super) fn of<const N: usize>(&self, machine: &Machine<N>) -> Result<Vec<Break>, InjectionError> {
        let names: Vec<&str> = machine.driven_axes().iter().map(|axis| axis.name.as_str()).collect();
        let all = self.0.iter().map(|(tick, broken)| {
            let of_axis = match broken {
                Broken::EmergencyStop => None,
                Broken::Axis(name, injection) => {
                    let axis = names.iter().position(|axis| axis == name);
                    let missing = || InjectionError::Axis(name.clone(), names.join(", "));
                    Some((axis.ok_or_else(missing)?, *injection))
                }
            };
            Ok(Break { tick: *tick, of_axis })
        });
        all.collect()
    }
}

/// Something that breaks before a tick: of an axis, from 0, or else the emergency stop opens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Break {
    pub(super) tick: u64,
    pub(super) of_axis: Option<(usize, Injection)>,
}

impl FromStr for Injections {
    type Err = InjectionError;

    fn from_str(text: &str) -> Result<Self, InjectionError> {
        let mut all: Vec<(u64, Broken)> = Vec::new();
        for part in text.split(',') {
            let part = part.trim();
            let of_tick = || InjectionError::Tick(part.to_owned());
            let (tick, fault) = part.split_once(':').ok_or_else(of_tick)?;
            let tick = tick.trim().parse().map_err(|_| of_tick())?;
            let fault = fault.trim();
            let broken = broken(fault).ok_or_else(|| InjectionError::Fault(fault.to_owned()))?;
            if let Some((last, _)) = all.last().filter(|(last, _)| *last > tick) {
                return Err(InjectionError::Order(tick, *last));
            }
            all.push((tick, broken));
        }
        Ok(Self(all))
    }
}

fn broken(fault: &str) -> Option<Broken> {
    if fault == "emergency-stop" {
        return Some(Broken::EmergencyStop);
    }
    let (name, of) = fault.split_once('=')?;
    let (axis, value) = of.split_once(':').map_or((of, None), |(axis, value)| (axis, Some(value)));
    let number = || value?.parse::<f64>().ok().filter(|number| number.is_finite());
    let injection = match (name, value) {
        ("encoder-lost", None) => Injection::EncoderLost,
        ("encoder-jump", Some(counts)) => Injection::EncoderJump { counts: counts.parse().ok()? },
        ("encoder-reversed", None) => Injection::EncoderReversed,
        ("drive-reversed", None) => Injection::DriveReversed,
        ("overload", _) => Injection::Overload { accel_limit_mm_s2: number().filter(|limit| *limit > 0.0)? },
        ("drive-not-ready", None) => Injection::DriveNotReady,
        ("drive-fault", None) => Injection::DriveFault,
        ("limit-low", _) => Injection::LimitLow { at_mm: number()? },
        ("limit-high", _) => Injection::LimitHigh { at_mm: number()? },
        _ => return None,
    };
    (!axis.is_empty()).then(|| Broken::Axis(axis.to_owned(), injection))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_read_as_it_is_written() {
        for (written, _) in INJECTIONS {
            let text = ["COUNTS", "ACCELERATION", "POSITION"]
                .iter()
                .fold(written.replace("AXIS", "Y"), |text, value| text.replace(value, "12"));
            let read: Injections = format!("7:{text}").parse().expect(written);
            assert_eq!(read.0.len(), 1);
            assert!(read.of(&Machine::reference()).is_ok());
            // A value where none belongs, or none where one does.
            let wrong = text.strip_suffix(":12").map_or(format!("{text}:12"), str::to_owned);
            assert!(format!("7:{wrong}").parse::<Injections>().is_err(), "{wrong}");
        }
        let read: Injections = " 5:encoder-jump=X:-300, 5:overload=Y:12.5".parse().expect("two");
        let jump = Broken::Axis("X".to_owned(), Injection::EncoderJump { counts: -300 });
        let overload = Broken::Axis("Y".to_owned(), Injection::Overload { accel_limit_mm_s2: 12.5 });
        assert_eq!(read.0, [(5, jump), (5, overload)]);
    }

    #[test]
    fn a_refusal_names_what_was_found() {
        for (text, message) in [
            ("", "found ``, expected TICK:FAULT such as 2000:encoder-lost=X"),
            ("x:emergency-stop", "found `x:emergency-stop`, expected TICK:FAULT such as 2000:encoder-lost=X"),
            (
                "7:emergency-stop,6:emergency-stop",
                "found tick 6 behind tick 7, expected ticks in their order",
            ),
        ] {
            assert_eq!(text.parse::<Injections>().expect_err(text).to_string(), message);
        }
        for wrong in [
            "encoder-lost",
            "encoder-lost=",
            "overload=X:0",
            "overload=X:nan",
            "encoder-jump=X:0.5",
            "door=X",
        ] {
            let refused = format!("1:{wrong}").parse::<Injections>().expect_err(wrong).to_string();
            let begins = format!("found the fault `{wrong}`, expected encoder-lost=AXIS, ");
            assert!(refused.starts_with(&begins) && refused.ends_with(" or emergency-stop"), "{refused}");
        }
        let elsewhere: Injections = "1:drive-fault=Q".parse().expect("written well");
        let refused = elsewhere.of(&Machine::reference()).expect_err("no such axis");
        assert_eq!(refused.to_string(), "found the axis `Q`, expected one of X, Y, Z");
    }
}
