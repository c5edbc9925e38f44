//! Standard output that its reader may close early (`motion plan part.ngc | head`).

use std::io::{ErrorKind, Result, Write};

/// Drops all output after the reader is gone: the command completes its work and ends with its own exit
/// status.
pub(super) struct UntilClosed<W> {
    out: W,
    is_closed: bool,
}

impl<W: Write> UntilClosed<W> {
    pub(super) fn new(out: W) -> Self {
        Self { out, is_closed: false }
    }

    fn unless_closed<T>(&mut self, done: T, write: impl FnOnce(&mut W) -> Result<T>) -> Result<T> {
        if self.is_closed {
            return Ok(done);
        }
        match write(&mut self.out) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => {
                self.is_closed = true;
                Ok(done)
            }
            written => written,
        }
    }
}

impl<W: Write> Write for UntilClosed<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.unless_closed(bytes.len(), |out| out.write(bytes))
    }

    fn flush(&mut self) -> Result<()> {
        self.unless_closed((), Write::flush)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Error;

    use super::*;

    /// Takes some bytes, then fails.
    struct Failing(usize, ErrorKind);

    impl Write for Failing {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(Error::from(self.1))?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn only_a_reader_that_left_is_no_failure() {
        let mut out = UntilClosed::new(Failing(10, ErrorKind::BrokenPipe));
        for _ in 0..5 {
            out.write_all(b"1234").expect("taken or dropped");
        }
        assert_eq!(out.out.0, 2);
        out.flush().expect("nothing to flush");
        let mut out = UntilClosed::new(Failing(10, ErrorKind::StorageFull));
        let kinds = [(); 4].map(|()| out.write_all(b"1234").map_err(|error| error.kind()));
        assert_eq!(kinds, [Ok(()), Ok(()), Err(ErrorKind::StorageFull), Err(ErrorKind::StorageFull)]);
    }
}
