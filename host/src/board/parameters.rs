//! Reads and writes a board's parameters, and compares them.

use std::time::{Duration, Instant};

use motion_kernel::axis::Guards;
use motion_kernel::link::{Event, Identity, State};
use motion_kernel::program::{Header, ProgramError, Reader};
use serde_json::Value;

use super::connection::{Connection, Heard};
use super::error::BoardError;
use super::job;

/// The longest time for an answer, and for a board that starts anew.
const ANSWER: Duration = Duration::from_secs(20);
/// Between two looks at a board that checks what it was given.
const LOOK: Duration = Duration::from_millis(100);

/// What a board's parameters say, figure by figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures(Vec<(String, Value)>);

/// A figure that two machines have not in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its name, such as `axes[0].gains.kp_per_s`.
    pub name: String,
    /// What the first has.
    pub first: Option<Value>,
    /// What the second has.
    pub second: Option<Value>,
}

impl Figures {
    /// Those of a record for `M` axes.
    ///
    /// # Errors
    /// It is none.
    pub fn of<const M: usize>(record: &[u8]) -> Result<Self, ProgramError> {
        let reader = Reader::<M>::new(record)?;
        let (header, guards): (&Header<M>, Option<Guards<M>>) = (reader.header(), reader.guards()?);
        let mut figures = Vec::new();
        let (homing, compensation) = (reader.homing()?, reader.compensation()?);
        let values = [
            ("", serde_json::to_value(header)),
            ("", serde_json::to_value(guards)),
            ("homing", serde_json::to_value(homing)),
            ("compensation", serde_json::to_value(compensation)),
        ];
        for (name, value) in values {
            // All are structs of numbers.
            flatten(name, &value.unwrap_or(Value::Null), &mut figures);
        }
        Ok(Self(figures))
    }

    /// The figures with their names, in the record's order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.0.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// What differs from `other`.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<Difference> {
        let of = |figures: &Self, name: &str| {
            figures.0.iter().find(|(other, _)| other == name).map(|(_, value)| value.clone())
        };
        let mut names: Vec<&str> = self.iter().map(|(name, _)| name).collect();
        names.extend(other.iter().map(|(name, _)| name).filter(|name| of(self, name).is_none()));
        let differences = names.into_iter().map(|name| Difference {
            name: name.to_owned(),
            first: of(self, name),
            second: of(other, name),
        });
        differences.filter(|difference| difference.first != difference.second).collect()
    }
}

fn flatten(name: &str, value: &Value, figures: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(fields) => {
            for (field, value) in fields {
                let name = if name.is_empty() { field.clone() } else { format!("{name}.{field}") };
                flatten(&name, value, figures);
            }
        }
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                flatten(&format!("{name}[{index}]"), value, figures);
            }
        }
        value => figures.push((name.to_owned(), value.clone())),
    }
}

/// Reads a board's parameters: the bytes of a compiled program without items.
///
/// # Errors
/// The board is lost, or does not answer.
pub fn read<const M: usize>(connection: &mut Connection<M>) -> Result<Vec<u8>, BoardError> {
    let mut record = Vec::new();
    connection.read_parameters(0);
    until(connection, |event, connection| {
        let Event::Parameters { offset, length, piece } = event else { return Ok(None) };
        if offset as usize == record.len() {
            record.extend_from_slice(piece.bytes());
        }
        if record.len() >= length as usize {
            return Ok(Some(std::mem::take(&mut record)));
        }
        connection.read_parameters(record.len() as u32);
        Ok(None)
    })
}

/// Gives a board new parameters, and waits until it has started anew with them; returns what it is then.
///
/// # Errors
/// The board refuses them, is lost, or does not answer.
pub fn write<const M: usize>(connection: &mut Connection<M>, record: &[u8]) -> Result<Identity, BoardError> {
    let machine = job::checksum(record);
    connection.write_parameters(record, 0);
    until(connection, |event, connection| match event {
        Event::Written { error: Some(error), .. } => Err(BoardError::Parameters(error)),
        Event::Written { bytes, .. } => {
            // With all of them there it is asked what has become of them.
            if bytes as usize >= record.len() {
                std::thread::sleep(LOOK);
            }
            connection.write_parameters(record, bytes);
            Ok(None)
        }
        Event::Restarted { .. } => {
            connection.accept();
            match connection.identity() {
                Some(identity) if identity.machine != machine => {
                    Err(BoardError::OtherMachine { found: identity.machine, expected: machine })
                }
                identity => Ok(identity.copied()),
            }
        }
        _ => Ok(None),
    })
}

/// Has the drives switched off, and waits for that.
///
/// # Errors
/// The board is lost, or does not answer.
pub fn disable<const M: usize>(connection: &mut Connection<M>) -> Result<(), BoardError> {
    let mut is_told = false;
    until(connection, |event, connection| match event {
        Event::Status(_) if !is_told => {
            is_told = connection.command(|link| link.enable(false));
            Ok(None)
        }
        // Of the program after the command.
        Event::Status(_) => Ok(connection.status().filter(|status| status.state == State::Off).map(|_| ())),
        _ => Ok(None),
    })
}

/// Listens until `on_event` has a result.
pub(super) fn until<const M: usize, T>(
    connection: &mut Connection<M>,
    mut on_event: impl FnMut(Event<M>, &mut Connection<M>) -> Result<Option<T>, BoardError>,
) -> Result<T, BoardError> {
    let mut since = Instant::now();
    while since.elapsed() < ANSWER {
        let mut heard = Vec::new();
        connection.step(Duration::from_millis(10), &mut |one| heard.push(one));
        for one in heard {
            match one {
                Heard::Board(Event::Foreign(build)) => return Err(BoardError::foreign(&build)),
                Heard::Board(Event::Refused(identity)) => {
                    BoardError::unless_linked(&identity, M)?;
                }
                Heard::Board(event) => {
                    if !matches!(event, Event::Status(_) | Event::Written { .. }) {
                        since = Instant::now();
                    }
                    if let Some(result) = on_event(event, connection)? {
                        return Ok(result);
                    }
                }
                Heard::Lost(cause) => return Err(BoardError::Wire(std::io::Error::other(cause))),
                Heard::Back => {}
            }
        }
    }
    Err(BoardError::Silent)
}
