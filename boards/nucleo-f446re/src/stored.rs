//! The parameters of a board on the link, across reset and power.
//!
//! Consumes the record that the background took before the reset, and flash; produces the parameters that the board has until
//! the next one: the stored ones, or those of the program that it was built with.

use embedded_storage::nor_flash::NorFlash;
use motion_board::stored::{OVERHEAD, ParameterStore, Pending};
use motion_board::{LogLine, Origin};
use nucleo_f446re::design_parameters::{BOARD, PARAMETER_SECTORS, PARAMETERS_MAX};
use nucleo_f446re::machine::{AXES, Number, PROGRAM};

use crate::board;

/// Parameters that wait for the start after a reset.
// Not initialised: memory outside of it is, by code that runs before anything of this.
#[allow(unsafe_code)]
#[unsafe(link_section = ".uninit.PENDING")]
static PENDING: Pending<PARAMETERS_MAX> = Pending::new();

/// Keeps new parameters for the start after a reset; false if they are too long.
pub(crate) fn keep(parameters: &[u8]) -> bool {
    PENDING.put(parameters)
}

/// What this start has. Writes to flash what came before the reset: nothing else runs yet, and the drives are off.
#[inline(never)]
pub(crate) fn parameters(flash: impl NorFlash) -> &'static [u8] {
    let buffer: &'static mut [u8; PARAMETERS_MAX + OVERHEAD] = defmt::unwrap!(
        cortex_m::singleton!(: [u8; PARAMETERS_MAX + OVERHEAD] = [0; PARAMETERS_MAX + OVERHEAD])
    );
    let suits =
        |record: &[u8]| motion_board::Machine::<Number, AXES>::without_items(record, &BOARD).map(|_| ());
    let mut store = defmt::unwrap!(ParameterStore::new(flash, PARAMETER_SECTORS));
    let mut place = [0; PARAMETERS_MAX];
    let came = PENDING.take(&mut place).filter(|record| suits(record).is_ok());
    let error = came.and_then(|record| store.write(record, buffer).err());
    if let Some(error) = error {
        // Those before are there.
        board::write(&LogLine::<Number, AXES>::NotStored(error));
    }
    let (parameters, origin) = match store.read(buffer) {
        Err(error) => (PROGRAM, Origin::Unreadable(error)),
        Ok(None) => (PROGRAM, Origin::Build),
        Ok(Some(record)) => match suits(record) {
            Ok(()) => (record, Origin::Flash),
            Err(error) => (PROGRAM, Origin::Unsuitable(error)),
        },
    };
    board::write(&LogLine::<Number, AXES>::Parameters(origin));
    parameters
}
