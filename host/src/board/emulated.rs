//! A board in an emulator: QEMU with the image of `boards/qemu-mps2`, its machine simulated inside, its UART as a socket.

use std::fs::File;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use tempfile::NamedTempFile;
use thiserror::Error;

/// Where the image looks for what it is told at its start, as `boards/qemu-mps2/README.md` says: one record, the session, the
/// record's length, the record.
const ADDRESS: u32 = 0x20_0000;

/// The core that is emulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Core {
    /// Cortex-M4F, f32: mps2-an386.
    M4f,
    /// Cortex-M3, fixed point: mps2-an385.
    M3,
}

impl Core {
    fn machine(self) -> &'static str {
        match self {
            Self::M4f => "mps2-an386",
            Self::M3 => "mps2-an385",
        }
    }

    /// Where the tests build its image, from the repository's root.
    #[must_use]
    pub fn image(self) -> PathBuf {
        let target = match self {
            Self::M4f => "thumbv7em-none-eabihf",
            Self::M3 => "thumbv7m-none-eabi",
        };
        ["target/boards", target, "release/linked"].iter().collect()
    }
}

/// Why there is no emulated board. Displays as "found …, expected …".
#[derive(Debug, Error)]
pub enum EmulatedError {
    /// The image is not there.
    #[error(
        "{path}: found {source}, expected an image for the emulator; boards/qemu-mps2/README.md tells how to build it"
    )]
    Image {
        /// Its path.
        path: String,
        /// Why.
        source: io::Error,
    },
    /// The emulator can't be started.
    #[error("qemu-system-arm: found {0}, expected QEMU for Arm on the path")]
    Emulator(io::Error),
    /// The record can't be written for it.
    #[error("a temporary file: found {0}, expected a place for the board's parameters")]
    Record(io::Error),
    /// The image is made for three axes.
    #[error("found a machine of {0} axes, expected three, as the image has")]
    Axes(usize),
}

/// A running emulator; it is killed with this.
pub struct Emulated {
    child: Child,
    /// What it reads at its start.
    _record: NamedTempFile,
}

impl Emulated {
    /// Starts `image` with the parameters in `record`; its UART takes connections at `address`. `session` is a number that other
    /// starts do not have.
    ///
    /// # Errors
    /// See [`EmulatedError`].
    pub fn start(
        core: Core,
        image: &Path,
        record: &[u8],
        session: u32,
        address: SocketAddr,
    ) -> Result<Self, EmulatedError> {
        let path = || image.display().to_string();
        File::open(image).map_err(|source| EmulatedError::Image { path: path(), source })?;
        let mut file = NamedTempFile::new().map_err(EmulatedError::Record)?;
        file.write_all(record).and_then(|()| file.flush()).map_err(EmulatedError::Record)?;
        let word = |place: u32, data: u32| {
            format!("loader,addr={:#x},data={data:#x},data-len=4", ADDRESS + 4 * place)
        };
        let bytes = format!("loader,addr={:#x},file={},force-raw=on", ADDRESS + 12, file.path().display());
        let mut command = Command::new("qemu-system-arm");
        command
            .args(["-M", core.machine(), "-display", "none", "-monitor", "none"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(["-serial", &format!("tcp:{address},server=on,wait=off,nodelay=on")])
            .args(["-device", &word(0, 1), "-device", &word(1, session)])
            .args(["-device", &word(2, record.len() as u32), "-device", &bytes])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null());
        let child = command.spawn().map_err(EmulatedError::Emulator)?;
        Ok(Self { child, _record: file })
    }

    /// Whether it has ended.
    ///
    /// # Errors
    /// That is not known.
    pub fn has_ended(&mut self) -> io::Result<bool> {
        self.child.try_wait().map(|ended| ended.is_some())
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
