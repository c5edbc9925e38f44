//! A program as bytes, with the machine it is for.
//!
//! | bytes | content |
//! |---|---|
//! | 4 | `MOTN` |
//! | 1 | version of this format: 6, or 7 of a machine with compensation |
//! | 1 | number of axes |
//! | 2 | length of guards, homing and compensation together, least significant byte first; 0 for none |
//! | … | [`Guards`] in the [postcard](https://postcard.jamesmunns.com) wire format, and behind them, if any axis is homed or compensated, `HomingFigures`; a kernel without guards skips both. Behind them, in format 7, `Compensation`; a kernel without compensation does not read that format |
//! | … | [`Header`], in the same format |
//! | … | [`Item`]s to the end, each [as few bytes](super::compact) |
//! | 4 | CRC-32 (ISO-HDLC, the one of zip and Ethernet) of all before it, least significant byte first |
//!
//! A [`Reader`] is made only of a whole and undamaged program. [`check`](super::check()) tells a board
//! whether its items can be executed, before anything moves. Figures are kept in f64, so the program runs in
//! any number type and gives the same bits wherever it is read.

use serde::{Deserialize, Serialize};

use super::checksum::Checksum;
use super::compact::{Decoder, Encoder};
use super::{Item, wire};
#[cfg(feature = "compensation")]
use crate::axis::Compensation;
use crate::axis::{AxisFigures, Guards};
#[cfg(all(feature = "live", feature = "guards"))]
use crate::homing::HomingFigures;
use crate::law::Pulse;
use crate::queue::PathRules;
use crate::units::Position;

const MAGIC: [u8; 4] = *b"MOTN";
/// The version of this format, and of the items in it.
pub const FORMAT: u8 = 6;
/// The version of a program of a machine with compensation: a kernel that has none would drive it wrong.
const FORMAT_COMPENSATED: u8 = 7;
const PREFIX: usize = MAGIC.len() + 2;
/// Axes of the largest machine.
const AXES_MAX: usize = 9;
/// Greatest length of guards, a header or an item with that many axes \[bytes\].
const ENTRY_MAX: usize = 4096;

/// The machine and tick that a program was planned for. A board executes it with these or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header<const AXES: usize> {
    /// The control tick \[s\].
    pub tick_s: f64,
    /// The limits that the streams check items against.
    pub rules: PathRules,
    /// The shape of the pulses of jerk with which a board plans anew. The program's own ramps may have
    /// another.
    pub pulse: Pulse,
    /// The machine's axes.
    #[serde(with = "crate::array")]
    pub axes: [AxisFigures; AXES],
    /// Where the machine stands when it starts.
    #[serde(with = "crate::array")]
    pub start: [Position; AXES],
}

/// Why bytes are not a program for this kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ProgramError {
    /// It does not begin with `MOTN`, or is shorter than the shortest program.
    NotAProgram,
    /// It has another version of the format.
    Version {
        /// Its version; 6 is expected, or 7 by a kernel with compensation.
        found: u8,
    },
    /// It is for a machine with another number of axes.
    Axes {
        /// The program's.
        found: u8,
        /// The kernel's.
        expected: usize,
    },
    /// It has been damaged.
    Checksum {
        /// The checksum of the bytes received.
        found: u32,
        /// The checksum in the program.
        expected: u32,
    },
    /// The checksum is right, but there is no header, guards or item where one should be.
    Malformed {
        /// Bytes from the start of the program.
        at: usize,
    },
}

impl core::fmt::Display for ProgramError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotAProgram => write!(f, "no compiled program: expected MOTN at its start"),
            Self::Version { found } if cfg!(feature = "compensation") => {
                write!(f, "format {found}, expected {FORMAT} or {FORMAT_COMPENSATED}")
            }
            Self::Version { found } => {
                write!(f, "format {found}, expected {FORMAT}, of a machine without compensation")
            }
            Self::Axes { found, expected } => write!(f, "a program for {found} axes, expected {expected}"),
            Self::Checksum { found, expected } => {
                write!(f, "damaged: checksum {found:08x}, expected {expected:08x}")
            }
            Self::Malformed { at } => write!(f, "no header, guards or item at byte {at}"),
        }
    }
}

impl core::error::Error for ProgramError {}

/// Appends a program to `out`.
///
/// # Errors
/// There are more than nine axes, for which an entry may exceed the format's bound; or there is a block, and the
/// kernel is one without live control.
pub fn write<'a, const AXES: usize>(
    header: &Header<AXES>,
    guards: Option<&Guards<AXES>>,
    items: impl IntoIterator<Item = &'a Item<AXES>>,
    out: &mut impl Extend<u8>,
) -> Result<(), postcard::Error> {
    let mut entry = [0; ENTRY_MAX];
    let guards = match guards {
        Some(guards) => &*postcard::to_slice(guards, &mut entry)?,
        None => &[],
    };
    write_guarded(FORMAT, header, guards, items, out)
}

/// [`write`](write()) with guards, and how the axes are homed.
///
/// # Errors
/// See [`write`](write()).
#[cfg(all(feature = "live", feature = "guards"))]
pub fn write_homed<'a, const AXES: usize>(
    header: &Header<AXES>,
    guards: &Guards<AXES>,
    homing: &HomingFigures<AXES>,
    items: impl IntoIterator<Item = &'a Item<AXES>>,
    out: &mut impl Extend<u8>,
) -> Result<(), postcard::Error> {
    if *homing == HomingFigures::NONE {
        return write(header, Some(guards), items, out);
    }
    let mut entry = [0; ENTRY_MAX];
    let entry = postcard::to_slice(&(guards, homing), &mut entry)?;
    write_guarded(FORMAT, header, entry, items, out)
}

/// [`write_homed`] with the compensation of the axes.
///
/// # Errors
/// See [`write`](write()).
#[cfg(feature = "compensation")]
pub fn write_compensated<'a, const AXES: usize>(
    header: &Header<AXES>,
    guards: &Guards<AXES>,
    homing: &HomingFigures<AXES>,
    compensation: &Compensation<AXES>,
    items: impl IntoIterator<Item = &'a Item<AXES>>,
    out: &mut impl Extend<u8>,
) -> Result<(), postcard::Error> {
    if *compensation == Compensation::NONE {
        return write_homed(header, guards, homing, items, out);
    }
    let mut entry = [0; ENTRY_MAX];
    let entry = postcard::to_slice(&(guards, homing, compensation), &mut entry)?;
    write_guarded(FORMAT_COMPENSATED, header, entry, items, out)
}

/// Writes with guards that are written already.
fn write_guarded<'a, const AXES: usize>(
    format: u8,
    header: &Header<AXES>,
    guards: &[u8],
    items: impl IntoIterator<Item = &'a Item<AXES>>,
    out: &mut impl Extend<u8>,
) -> Result<(), postcard::Error> {
    if AXES > AXES_MAX {
        return Err(postcard::Error::SerializeBufferFull);
    }
    let mut sum = Checksum::NONE;
    let mut put = |bytes: &[u8]| {
        sum.update(bytes);
        out.extend(bytes.iter().copied());
    };
    let mut entry = [0; ENTRY_MAX];
    put(&MAGIC);
    put(&[format, AXES as u8]);
    // An entry is shorter than 2¹⁶ bytes.
    put(&(guards.len() as u16).to_le_bytes());
    put(guards);
    put(postcard::to_slice(header, &mut entry)?);
    let mut encoder = Encoder::new();
    for item in items {
        // There is room, but a kernel without live control has no blocks.
        let length = encoder.encode(item, &mut entry).ok_or(postcard::Error::SerdeSerCustom)?;
        put(entry.get(..length).unwrap_or_default());
    }
    out.extend(sum.finish().to_le_bytes());
    Ok(())
}

/// A program, read from bytes that stay in place.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a, const AXES: usize> {
    header: Header<AXES>,
    #[cfg(feature = "guards")]
    guards: &'a [u8],
    #[cfg(feature = "compensation")]
    is_compensated: bool,
    items: &'a [u8],
    /// Where the items end, from the start of the program.
    end: usize,
    /// All before the items.
    #[cfg(feature = "link")]
    machine: &'a [u8],
}

/// A program's items, in order, with what they have in common with the items before. The header, a kilobyte, stays
/// with the [`Reader`].
#[derive(Clone, Copy, Debug)]
pub struct Items<'a, const AXES: usize> {
    left: &'a [u8],
    /// Where the items end, from the start of the program.
    end: usize,
    decoder: Decoder<AXES>,
}

impl<'a, const AXES: usize> Reader<'a, AXES> {
    /// The program in `bytes`, which end with it.
    ///
    /// # Errors
    /// The bytes are not one whole, undamaged program for `AXES` axes.
    pub fn new(bytes: &'a [u8]) -> Result<Self, ProgramError> {
        let (summed, checksum) = bytes.split_last_chunk().ok_or(ProgramError::NotAProgram)?;
        let (magic, rest) = summed.split_first_chunk().ok_or(ProgramError::NotAProgram)?;
        let (&[version, axes], body) = rest.split_first_chunk().ok_or(ProgramError::NotAProgram)?;
        if *magic != MAGIC {
            return Err(ProgramError::NotAProgram);
        }
        let is_compensated = cfg!(feature = "compensation") && version == FORMAT_COMPENSATED;
        if version != FORMAT && !is_compensated {
            return Err(ProgramError::Version { found: version });
        }
        if usize::from(axes) != AXES {
            return Err(ProgramError::Axes { found: axes, expected: AXES });
        }
        let (found, expected) = (Checksum::of(summed), u32::from_le_bytes(*checksum));
        if found != expected {
            return Err(ProgramError::Checksum { found, expected });
        }
        let guards = body
            .split_first_chunk()
            .and_then(|(&length, left)| left.split_at_checked(u16::from_le_bytes(length).into()));
        let (_guards, body) = guards.ok_or(ProgramError::Malformed { at: PREFIX })?;
        let at = summed.len() - body.len();
        let (header, left) = wire::take(body).ok_or(ProgramError::Malformed { at })?;
        Ok(Self {
            header,
            #[cfg(feature = "guards")]
            guards: _guards,
            #[cfg(feature = "compensation")]
            is_compensated,
            items: left,
            end: summed.len(),
            #[cfg(feature = "link")]
            machine: summed.get(..summed.len() - left.len()).unwrap_or_default(),
        })
    }

    /// The machine and tick that the program was planned for.
    pub fn header(&self) -> &Header<AXES> {
        &self.header
    }

    /// The guards of the machine's axes and the reactions to faults; `None` if the program has none.
    ///
    /// # Errors
    /// The bytes in their place are something else.
    #[cfg(feature = "guards")]
    pub fn guards(&self) -> Result<Option<Guards<AXES>>, ProgramError> {
        if self.guards.is_empty() {
            return Ok(None);
        }
        match wire::take(self.guards) {
            // Homing may follow.
            Some((guards, rest)) if rest.is_empty() || cfg!(feature = "live") => Ok(Some(guards)),
            _ => Err(ProgramError::Malformed { at: PREFIX + 2 }),
        }
    }

    /// How the machine's axes are homed.
    ///
    /// # Errors
    /// The bytes in its place are something else.
    #[cfg(all(feature = "live", feature = "guards"))]
    pub fn homing(&self) -> Result<HomingFigures<AXES>, ProgramError> {
        if self.guards.is_empty() {
            return Ok(HomingFigures::NONE);
        }
        let behind = wire::take::<Guards<AXES>>(self.guards).map(|(_, behind)| behind);
        match behind.map(|behind| (behind.is_empty(), wire::take(behind))) {
            Some((true, _)) => Ok(HomingFigures::NONE),
            // Compensation may follow.
            Some((false, Some((homing, rest)))) if rest.is_empty() != self.is_compensated() => Ok(homing),
            _ => Err(ProgramError::Malformed { at: PREFIX + 2 }),
        }
    }

    /// Whether an axis of the machine is compensated: never in a kernel without compensation, which refuses such programs.
    #[must_use]
    pub fn is_compensated(&self) -> bool {
        #[cfg(feature = "compensation")]
        return self.is_compensated;
        #[cfg(not(feature = "compensation"))]
        false
    }

    /// The compensation of the machine's axes.
    ///
    /// # Errors
    /// The bytes in its place are something else.
    #[cfg(feature = "compensation")]
    pub fn compensation(&self) -> Result<Compensation<AXES>, ProgramError> {
        if !self.is_compensated {
            return Ok(Compensation::NONE);
        }
        let behind_guards = wire::take::<Guards<AXES>>(self.guards).map(|(_, behind)| behind);
        let behind = behind_guards.and_then(wire::take::<HomingFigures<AXES>>).map(|(_, behind)| behind);
        match behind.and_then(wire::take) {
            Some((compensation, [])) => Ok(compensation),
            _ => Err(ProgramError::Malformed { at: PREFIX + 2 }),
        }
    }

    /// The checksum of the machine and tick that it was planned for: the one that a program without items ends with. Two
    /// programs have the same if they are for the same machine.
    #[cfg(feature = "link")]
    #[must_use]
    pub fn machine_checksum(&self) -> u32 {
        Checksum::of(self.machine)
    }

    /// All of its items.
    pub fn items(&self) -> Items<'a, AXES> {
        Items { left: self.items, end: self.end, decoder: Decoder::new() }
    }
}

impl<const AXES: usize> Iterator for Items<'_, AXES> {
    type Item = Result<Item<AXES>, ProgramError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.left.is_empty() {
            return None;
        }
        let at = self.end - self.left.len();
        Some(match self.decoder.take(self.left) {
            Some((item, left)) => {
                self.left = left;
                Ok(item)
            }
            None => {
                self.left = &[];
                Err(ProgramError::Malformed { at })
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{Feedforward, GuardFigures};
    use crate::fault::{Reaction, Reactions};
    use crate::fixture::{GUARD, RULES, figures};
    use crate::hal::{OutputState, Spindle};
    use crate::law::{Pulse, Ticks};

    fn header() -> Header<2> {
        let feedforward =
            Feedforward { velocity: 1.0, accel_s: 1.675e-3, jerk_s2: 2.2e-5, ..Feedforward::default() };
        Header {
            tick_s: 0.0005,
            rules: RULES,
            pulse: Pulse::Plateau,
            axes: [AxisFigures { feedforward, ..figures() }; 2],
            start: [Position::ZERO, Position::from_bits(-7)],
        }
    }

    fn guards() -> Guards<2> {
        let figures = GuardFigures { noise_counts: 300, travel_mm: Some([-10.0, 250.5]), ..GUARD };
        let reactions = Reactions { ramp_ticks: 200, stop_ticks: 4000, emergency_stop: Reaction::Ramp };
        Guards { axes: [None, Some(figures)], reactions }
    }

    fn program() -> (Vec<Item<2>>, Vec<u8>) {
        let at = [Position::from_bits(i64::MIN), Position::from_bits(i64::MAX)];
        let items = vec![
            Item::Line { line: 3, start: at, direction: [0.6, -0.8], length: Position::from_bits(1 << 40) },
            Item::Septic { line: u32::MAX, start: at, coefficients: [[f64::MIN; 7]; 2], length: at[1] },
            Item::EndOfStretch(at),
            Item::Dwell(Ticks::ONE),
            Item::Stop,
            Item::Switch(OutputState {
                spindle: Spindle::Counterclockwise,
                speed_rpm: 1e9,
                flood: true,
                mist: false,
            }),
        ];
        let mut bytes = Vec::new();
        write(&header(), Some(&guards()), &items, &mut bytes).expect("short entries");
        (items, bytes)
    }

    #[test]
    fn what_is_written_is_read() {
        let (items, bytes) = program();
        let reader = Reader::<2>::new(&bytes).expect("a program");
        assert_eq!(*reader.header(), header());
        #[cfg(feature = "guards")]
        assert_eq!(reader.guards(), Ok(Some(guards())));
        assert_eq!(reader.items().collect::<Result<Vec<_>, _>>(), Ok(items));
    }

    /// A program of the same machine without items ends with it; one of another machine does not.
    #[cfg(feature = "link")]
    #[test]
    fn the_machine_has_a_checksum() {
        let of = |bytes: &[u8]| Reader::<2>::new(bytes).expect("a program").machine_checksum();
        let (_, bytes) = program();
        for guards in [Some(guards()), None] {
            let mut without = Vec::new();
            write(&header(), guards.as_ref(), &[], &mut without).expect("short entries");
            let sum = without.last_chunk().map(|sum| u32::from_le_bytes(*sum));
            assert_eq!(Some(of(&without)), sum);
            assert_eq!(of(&bytes) == of(&without), guards.is_some());
        }
        let mut other = Vec::new();
        let header = Header { tick_s: 0.00025, ..header() };
        write(&header, Some(&guards()), &[], &mut other).expect("short entries");
        assert_ne!(of(&other), of(&bytes));
    }

    /// Guards, homing and compensation lie behind each other; without compensation the bytes are those without the feature.
    #[cfg(feature = "compensation")]
    #[test]
    fn compensation_is_written_and_read() {
        use crate::axis::{AxisCompensation, Backlash, PitchError};
        let points: Vec<f64> = (0..32).map(|index| 3.0 * f64::from(index) - 47.11).collect();
        let pitch_error = PitchError::new(-80.5, 12.25, &points, false);
        assert!(pitch_error.is_some());
        let backlash = Some(Backlash { play_mm: 0.0125, take_up_s: 0.007 });
        let compensation = Compensation { axes: [None, Some(AxisCompensation { backlash, pitch_error })] };
        let mut bytes = Vec::new();
        let (homing, (items, without)) = (HomingFigures::NONE, program());
        write_compensated(&header(), &guards(), &homing, &compensation, &items, &mut bytes).expect("short");
        let reader = Reader::<2>::new(&bytes).expect("a program");
        assert!(reader.is_compensated());
        assert_eq!(reader.compensation(), Ok(compensation));
        assert_eq!((reader.guards(), reader.homing()), (Ok(Some(guards())), Ok(homing)));
        assert_eq!(*reader.header(), header());
        assert_eq!(reader.items().collect::<Result<Vec<_>, _>>(), Ok(items.clone()));
        let mut again = Vec::new();
        write_compensated(&header(), &guards(), &homing, &Compensation::NONE, &items, &mut again)
            .expect("short");
        assert_eq!(again, without);
        let reader = Reader::<2>::new(&again).expect("a program");
        assert_eq!((reader.is_compensated(), reader.compensation()), (false, Ok(Compensation::NONE)));
        // Of the other format either has too much, or too little.
        for (mut bytes, format) in [(bytes, FORMAT), (without, FORMAT_COMPENSATED)] {
            bytes[MAGIC.len()] = format;
            bytes.truncate(bytes.len() - 4);
            bytes.extend(Checksum::of(&bytes).to_le_bytes());
            let reader = Reader::<2>::new(&bytes).expect("a program");
            let found = reader.homing().map(|_| ()).and(reader.compensation().map(|_| ()));
            assert_eq!(found, Err(ProgramError::Malformed { at: PREFIX + 2 }), "format {format}");
        }
    }

    /// Entries are longest with every figure there and every number at its longest.
    #[test]
    fn nine_axes_fit_and_ten_are_refused() {
        use crate::axis::{BedInverse, DriveInverse, TABLE_POINTS, Table, Tables};
        let table = Some(Table { reach: 1.0, mm_s_per_step: 1.0, steps: [i16::MAX; TABLE_POINTS] });
        let bed = Some(BedInverse { frequency_hz: 30.0, damping_ratio: 0.1, mass_ratio: 0.1 });
        let drive = DriveInverse {
            velocity_gain_per_s: 100.0,
            integral_time_s: 0.01,
            current_lag_s: 1e-3,
            viscous_friction_per_s: 1.0,
            coulomb_friction_mm_s2: 1.0,
            reversal_mm_s: 1.0,
            bed,
        };
        let mut axis = header().axes[0];
        axis.feedforward.tables = Tables { velocity: table, accel: table, jerk: table };
        axis.feedforward.drive = Some(drive);
        fn longest<const AXES: usize>(axis: AxisFigures) -> Result<usize, postcard::Error> {
            let Header { tick_s, rules, pulse, .. } = header();
            let far = [Position::from_bits(i64::MIN); AXES];
            let header = Header { tick_s, rules, pulse, axes: [axis; AXES], start: far };
            let figures = GuardFigures { noise_counts: u16::MAX, ..guards().axes[1].expect("figures") };
            let reactions = Reactions { ramp_ticks: u16::MAX, stop_ticks: u32::MAX, ..guards().reactions };
            let guards = Guards { axes: [Some(figures); AXES], reactions };
            let item =
                Item::Septic { line: u32::MAX, start: far, coefficients: [[1.0; 7]; AXES], length: far[0] };
            let mut bytes = Vec::new();
            #[cfg(feature = "compensation")]
            {
                use crate::axis::{AxisCompensation, Backlash, PitchError};
                use crate::homing::{AxisHoming, HomingConfig};
                use crate::jog::Direction;
                let config = HomingConfig {
                    direction: Direction::Negative,
                    fast_mm_s: 1.0,
                    slow_mm_s: 1.0,
                    travel_mm: 1.0,
                    back_off_mm: 1.0,
                    index_mm: Some(1.0),
                    position: far[0],
                    park: Some(far[0]),
                };
                let homing = AxisHoming { config, feed_mm_s: 1.0, limits: RULES.limits };
                let homing = HomingFigures { axes: [Some(homing); AXES] };
                let compensation = AxisCompensation {
                    backlash: Some(Backlash { play_mm: 0.1, take_up_s: 0.1 }),
                    pitch_error: PitchError::new(0.1, 0.1, &[-300.0; 32], true),
                };
                let compensation = Compensation { axes: [Some(compensation); AXES] };
                write_compensated(&header, &guards, &homing, &compensation, &[item], &mut bytes)
                    .map(|()| bytes.len())
            }
            #[cfg(not(feature = "compensation"))]
            write(&header, Some(&guards), &[item], &mut bytes).map(|()| bytes.len())
        }
        assert!(longest::<9>(axis).is_ok_and(|bytes| bytes > 2000));
        assert_eq!(longest::<10>(axis), Err(postcard::Error::SerializeBufferFull));
    }

    /// What is behind a good checksum and is none: guards of another length than said.
    #[cfg(feature = "guards")]
    #[test]
    fn guards_are_whole_or_refused() {
        let (_, bytes) = program();
        let mut without = Vec::new();
        write(&header(), None, &[], &mut without).expect("short entries");
        let at = PREFIX;
        assert_eq!(Reader::<2>::new(&without).expect("a program").guards(), Ok(None));
        for length in [1, 20, u16::from_le_bytes([bytes[at], bytes[at + 1]]) - 1, u16::MAX] {
            let mut bytes = bytes[..bytes.len() - 4].to_vec();
            bytes[at..at + 2].copy_from_slice(&length.to_le_bytes());
            bytes.extend(Checksum::of(&bytes).to_le_bytes());
            let found = Reader::<2>::new(&bytes).and_then(|program| program.guards().map(|_| ()));
            assert!(matches!(found, Err(ProgramError::Malformed { .. })), "{length}: {found:?}");
        }
    }

    /// Every single damaged byte, every shorter program, and every kind of stranger.
    #[test]
    fn anything_else_is_refused() {
        let (_, bytes) = program();
        for index in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[index] ^= 0x10;
            assert!(Reader::<2>::new(&damaged).is_err(), "byte {index}");
            assert!(Reader::<2>::new(&bytes[..index]).is_err(), "{index} bytes");
        }
        assert_eq!(Reader::<3>::new(&bytes).err(), Some(ProgramError::Axes { found: 2, expected: 3 }));
        assert_eq!(Reader::<2>::new(b"G1 X10 F600\nM2\n").err(), Some(ProgramError::NotAProgram));
    }
}
