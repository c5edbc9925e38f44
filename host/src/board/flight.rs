//! The ticks that a board's flight recorder has kept, read over the link.

use motion_kernel::flight::FlightRow;
use motion_kernel::link::Event;

use super::connection::Connection;
use super::error::BoardError;
use super::parameters::until;

/// The rows, oldest first; none where the board has kept none: there was no fault since it started, or since the last one was
/// cleared. A row that is lost on the way is asked for again; where another fault comes meanwhile, its rows are read.
///
/// # Errors
/// The board is lost, does not answer, or has cleared the fault meanwhile.
pub fn read<const M: usize>(connection: &mut Connection<M>) -> Result<Vec<FlightRow<f64, M>>, BoardError> {
    let mut kept = Kept(Vec::new());
    connection.read_flight(0);
    until(connection, |event, connection| {
        let Event::Flight { row, rows, kept: found } = event else { return Ok(None) };
        match kept.put(row, rows, found)? {
            Some(next) => connection.read_flight(next),
            None => return Ok(Some(std::mem::take(&mut kept.0))),
        }
        Ok(None)
    })
}

/// What has come of a record.
struct Kept<const M: usize>(Vec<FlightRow<f64, M>>);

impl<const M: usize> Kept<M> {
    /// Takes row number `row` of `rows`; the number of the next one, none where all are there.
    fn put(
        &mut self,
        row: u16,
        rows: u16,
        found: Option<FlightRow<f64, M>>,
    ) -> Result<Option<u16>, BoardError> {
        let Self(kept) = self;
        let Some(found) = found else {
            return if kept.is_empty() { Ok(None) } else { Err(BoardError::FlightCleared) };
        };
        // The rows of a record are those of consecutive ticks.
        let follows = kept.last().is_none_or(|last| found.tick == last.tick.wrapping_add(1));
        if follows && usize::from(row) == kept.len() {
            kept.push(found);
        } else {
            kept.clear();
        }
        let next = kept.len() as u16;
        Ok((next < rows || kept.is_empty()).then_some(next))
    }
}

#[cfg(test)]
mod tests {
    use motion_kernel::exec::ExecState;
    use motion_kernel::law::PathMotion;

    use super::*;

    fn row(tick: u64) -> FlightRow<f64, 0> {
        FlightRow {
            tick,
            motion: PathMotion::default(),
            stretches: 0,
            line: 0,
            state: ExecState::Idle,
            emergency_stop: false,
            is_faulted: true,
            axes: [],
        }
    }

    /// A record that takes the place of one that is read is read instead, from its first row on.
    #[test]
    fn rows_of_two_faults_are_not_mixed() {
        let mut kept = Kept(Vec::new());
        let mut put = |number: u16, tick: u64| kept.put(number, 4, Some(row(tick))).expect("a row");
        assert_eq!([put(0, 10), put(1, 11)], [Some(1), Some(2)]);
        // The second record's.
        assert_eq!(put(2, 902), Some(0));
        assert_eq!([put(0, 900), put(1, 901), put(2, 902), put(3, 903)], [Some(1), Some(2), Some(3), None]);
        let ticks: Vec<u64> = kept.0.iter().map(|row| row.tick).collect();
        assert_eq!(ticks, [900, 901, 902, 903]);
    }

    #[test]
    fn a_record_that_is_cleared_meanwhile_is_told() {
        let mut kept = Kept::<0>(Vec::new());
        assert_eq!(kept.put(0, 0, None).expect("nothing"), None);
        assert_eq!(kept.put(0, 4, Some(row(10))).expect("a row"), Some(1));
        assert!(matches!(kept.put(1, 0, None), Err(BoardError::FlightCleared)));
    }
}
