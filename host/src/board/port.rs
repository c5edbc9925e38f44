//! Where a board is.

use std::fmt;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::wire::{Serial, Tcp, Wire};

/// The longest time for a connection to an address.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

/// Where a board is. Displays as the text it is read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// Behind an address, `HOST:PORT`.
    Tcp(String),
    /// At a serial port, by its path or name.
    Serial(String),
    /// The simulated machine, in this process.
    Simulator,
}

/// Why a text is no port. Displays as "found …, expected …".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{0}`, expected tcp:HOST:PORT, a serial port such as /dev/ttyACM0 or COM3, or simulator")]
pub struct PortError(String);

impl FromStr for Port {
    type Err = PortError;

    fn from_str(text: &str) -> Result<Self, PortError> {
        let refused = || PortError(text.to_owned());
        if text == "simulator" {
            return Ok(Self::Simulator);
        }
        if let Some(address) = text.strip_prefix("tcp:") {
            let (host, port) = address.rsplit_once(':').ok_or_else(refused)?;
            return match port.parse::<u16>() {
                Ok(1..) if !host.is_empty() => Ok(Self::Tcp(address.to_owned())),
                _ => Err(refused()),
            };
        }
        let is_com = text.strip_prefix("COM").is_some_and(|number| number.parse::<u16>().is_ok());
        if text.starts_with('/') || is_com { Ok(Self::Serial(text.to_owned())) } else { Err(refused()) }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Serial(path) => f.write_str(path),
            Self::Simulator => f.write_str("simulator"),
        }
    }
}

impl Port {
    /// Opens it; a serial port at `baud` bits/s.
    ///
    /// # Errors
    /// Nobody is there, or it is in use. The simulator has no wire of its own:
    /// [`simulator::start`](super::simulator::start) makes one.
    pub fn open(&self, baud: u32) -> io::Result<Box<dyn Wire>> {
        match self {
            Self::Tcp(address) => {
                let mut refused = None;
                for address in address.to_socket_addrs()? {
                    match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
                        Ok(stream) => return Ok(Box::new(Tcp::new(stream)?)),
                        Err(error) => refused = Some(error),
                    }
                }
                Err(refused.unwrap_or_else(|| io::Error::other("no such host")))
            }
            Self::Serial(path) => Ok(Box::new(Serial::open(path, baud)?)),
            Self::Simulator => Err(io::Error::other("no wire")),
        }
    }
}

/// A number that no other start has: of the time.
#[must_use]
pub fn unique() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    now.as_secs() as u32 ^ now.subsec_nanos().rotate_left(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_read_or_says_what_it_should_be() {
        for text in ["tcp:localhost:5000", "tcp:[::1]:7", "/dev/ttyACM0", "COM3", "simulator"] {
            assert_eq!(text.parse::<Port>().expect(text).to_string(), text);
        }
        for text in
            ["", "tcp:", "tcp:5000", "tcp:localhost:", "tcp:host:0", "tcp:host:70000", "COM", "ttyACM0"]
        {
            let error = text.parse::<Port>().expect_err(text).to_string();
            assert_eq!(
                error,
                format!(
                    "found `{text}`, expected tcp:HOST:PORT, a serial port such as /dev/ttyACM0 or COM3, or simulator"
                )
            );
        }
    }
}
