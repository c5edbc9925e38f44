//! The ticks that a board's flight recorder has kept, read over the link.

use motion_kernel::flight::FlightRow;
use motion_kernel::link::Event;

use super::connection::Connection;
use super::error::BoardError;
use super::parameters::until;

/// The rows, oldest first; none where the board has kept none: there was no fault since it started, or since the last one was
/// cleared. A row that is lost on the way is asked for again.
///
/// # Errors
/// The board is lost, does not answer, or has cleared the fault meanwhile.
pub fn read<const M: usize>(connection: &mut Connection<M>) -> Result<Vec<FlightRow<f64, M>>, BoardError> {
    let mut kept = Vec::new();
    connection.read_flight(0);
    until(connection, |event, connection| {
        let Event::Flight { rows, kept: row, .. } = event else { return Ok(None) };
        match row {
            None if kept.is_empty() => return Ok(Some(Vec::new())),
            None => return Err(BoardError::FlightCleared),
            Some(row) => kept.push(row),
        }
        if kept.len() >= usize::from(rows) {
            return Ok(Some(std::mem::take(&mut kept)));
        }
        connection.read_flight(kept.len() as u16);
        Ok(None)
    })
}
