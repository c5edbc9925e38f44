//! Bytes to a board and back.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use serialport::SerialPort;

/// The longest time that writing may take; then the wire counts as broken.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// The shortest time that a system waits.
const WAIT_MIN: Duration = Duration::from_millis(1);

/// A wire to a board.
pub trait Wire: Send {
    /// Reads what has come, and waits at most `wait` for its first byte; 0 if nothing came.
    ///
    /// # Errors
    /// The wire is broken.
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize>;

    /// Writes all of `bytes`.
    ///
    /// # Errors
    /// The wire is broken.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// What a read with a time-out returned: none for nothing in time.
fn in_time(read: io::Result<usize>) -> io::Result<usize> {
    match read {
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(0),
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(0),
        read => read,
    }
}

/// A socket.
pub struct Tcp(TcpStream);

impl Tcp {
    /// A connected socket.
    ///
    /// # Errors
    /// Its options can't be set.
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        // A hold is short, and must not wait for more bytes.
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        Ok(Self(stream))
    }
}

impl Wire for Tcp {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.0.set_read_timeout(Some(wait.max(WAIT_MIN)))?;
        match self.0.read(bytes) {
            Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "the other end has closed the connection")),
            read => in_time(read),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// A serial port.
pub struct Serial(Box<dyn SerialPort>);

impl Serial {
    /// Opens `path` at `baud` bits/s, 8 bits, no parity, one stop bit.
    ///
    /// # Errors
    /// There is no such port, or it can't be used so.
    pub fn open(path: &str, baud: u32) -> io::Result<Self> {
        Ok(Self(serialport::new(path, baud).timeout(WRITE_TIMEOUT).open()?))
    }
}

impl Wire for Serial {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.0.set_timeout(wait.max(WAIT_MIN))?;
        in_time(self.0.read(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.set_timeout(WRITE_TIMEOUT)?;
        self.0.write_all(bytes)
    }
}

/// One end of a wire within this process.
pub struct Pipe {
    to: Sender<Vec<u8>>,
    from: Receiver<Vec<u8>>,
    /// What came and was not read yet.
    left: Vec<u8>,
}

impl Pipe {
    /// Both ends.
    #[must_use]
    pub fn pair() -> (Self, Self) {
        let ((to_second, from_first), (to_first, from_second)) = (channel(), channel());
        let end = |to, from| Self { to, from, left: Vec::new() };
        (end(to_second, from_second), end(to_first, from_first))
    }
}

impl Wire for Pipe {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        if self.left.is_empty() {
            self.left = match self.from.recv_timeout(wait) {
                Ok(came) => came,
                Err(RecvTimeoutError::Timeout) => return Ok(0),
                Err(RecvTimeoutError::Disconnected) => return Err(ErrorKind::BrokenPipe.into()),
            };
        }
        let count = self.left.len().min(bytes.len());
        bytes[..count].copy_from_slice(&self.left[..count]);
        self.left.drain(..count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.to.send(bytes.to_vec()).map_err(|_| ErrorKind::BrokenPipe.into())
    }
}
