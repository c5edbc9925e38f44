//! What an image prints, by semihosting, a portion at a time: each call stops the emulator.

use core::cell::RefCell;
use core::fmt::{self, Write as _};

use critical_section::Mutex;
use semihosting::io::{Stdout, Write as _, stdout};

/// Room for what has not been put out yet \[bytes\]; the small core has none to spare.
const ROOM: usize = if super::IS_SMALL { 0 } else { 4096 };

/// What has been printed, and where it goes.
struct Output {
    to: Option<Stdout>,
    bytes: [u8; ROOM],
    used: usize,
}

static OUTPUT: Mutex<RefCell<Output>> =
    Mutex::new(RefCell::new(Output { to: None, bytes: [0; ROOM], used: 0 }));

impl Output {
    fn flush(&mut self) -> fmt::Result {
        let Self { to, bytes, used } = self;
        bytes.get(..core::mem::take(used)).map_or(Ok(()), |bytes| put_out(to, bytes))
    }
}

impl fmt::Write for Output {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        if self.bytes.len() - self.used < text.len() {
            self.flush()?;
        }
        match self.bytes.get_mut(self.used..self.used + text.len()) {
            Some(room) => {
                room.copy_from_slice(text.as_bytes());
                self.used += text.len();
                Ok(())
            }
            None => put_out(&mut self.to, text.as_bytes()),
        }
    }
}

fn put_out(to: &mut Option<Stdout>, bytes: &[u8]) -> fmt::Result {
    if to.is_none() {
        *to = stdout().ok();
    }
    let Some(to) = to else { return Err(fmt::Error) };
    to.write_all(bytes).map_err(|_| fmt::Error)
}

/// One line.
pub fn line(text: fmt::Arguments<'_>) {
    critical_section::with(|cs| {
        // Where the host takes nothing, its test finds nothing.
        let _ = writeln!(OUTPUT.borrow_ref_mut(cs), "{text}");
    });
}

/// Puts out what is left.
pub(super) fn flush() {
    critical_section::with(|cs| {
        let _ = OUTPUT.borrow_ref_mut(cs).flush();
    });
}

/// Prints a line.
#[macro_export]
macro_rules! println {
    ($($text:tt)*) => {
        $crate::print::line(format_args!($($text)*))
    };
}
