//! Messages on the wire: a payload and its CRC-32, in COBS, ended by a zero.
//!
//! COBS leaves no zero within a frame, so whatever was lost or damaged, the next zero is a frame's end. Consumes payloads,
//! produces bytes; and back. What is damaged is dropped and counted.

use crate::program::Checksum;

/// The longest payload \[bytes\]: an item of nine axes fits.
pub(super) const PAYLOAD_MAX: usize = 720;
const CHECKED_MAX: usize = PAYLOAD_MAX + CHECKSUM;
/// The longest frame with its zero \[bytes\].
pub const FRAME_MAX: usize = cobs::max_encoding_length(CHECKED_MAX) + 1;
/// Bytes of the checksum.
const CHECKSUM: usize = 4;

/// A payload being written.
pub(super) struct Payload {
    bytes: [u8; CHECKED_MAX],
    length: usize,
}

impl Payload {
    /// Begins with `message`; `None` if it is too long.
    pub(super) fn of<T: serde::Serialize>(message: &T) -> Option<Self> {
        let mut payload = Self { bytes: [0; CHECKED_MAX], length: 0 };
        payload.length = postcard::to_slice(message, payload.bytes.get_mut(..PAYLOAD_MAX)?).ok()?.len();
        Some(payload)
    }

    /// The room that is left \[bytes\].
    pub(super) fn room(&self) -> usize {
        PAYLOAD_MAX - self.length
    }

    /// Appends bytes; false if there is no room for all of them.
    pub(super) fn push_all(&mut self, bytes: impl Iterator<Item = u8>) -> bool {
        for byte in bytes {
            let Some(place) =
                self.bytes.get_mut(..PAYLOAD_MAX).and_then(|places| places.get_mut(self.length))
            else {
                return false;
            };
            *place = byte;
            self.length += 1;
        }
        true
    }

    /// The frame, written to `out`, which needs [`FRAME_MAX`] bytes; its length, or 0 if there is no room for it.
    pub(super) fn frame(mut self, out: &mut [u8]) -> usize {
        let Some(payload) = self.bytes.get(..self.length) else { return 0 };
        let sum = Checksum::of(payload).to_le_bytes();
        let Some(place) = self.bytes.get_mut(self.length..self.length + CHECKSUM) else { return 0 };
        place.copy_from_slice(&sum);
        let Some(checked) = self.bytes.get(..self.length + CHECKSUM) else { return 0 };
        let Some((out, _)) = out.split_at_mut_checked(cobs::max_encoding_length(checked.len()) + 1) else {
            return 0;
        };
        let Ok(length) = cobs::try_encode(checked, out) else { return 0 };
        let Some(end) = out.get_mut(length) else { return 0 };
        *end = 0;
        length + 1
    }
}

/// Finds the frames among the bytes that come in.
#[derive(Clone, Debug)]
pub struct Deframer {
    bytes: [u8; FRAME_MAX],
    /// Number of bytes since the last zero, however many there is room for.
    count: usize,
    /// Number of bytes of the payload that came last.
    payload: usize,
    /// Number of damaged frames.
    damaged: u32,
}

impl Deframer {
    /// Before the first byte.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; FRAME_MAX], count: 0, payload: 0, damaged: 0 }
    }

    /// Number of frames that were damaged, cut or too long, since the start.
    #[must_use]
    pub const fn damaged(&self) -> u32 {
        self.damaged
    }

    /// Takes a byte; whether a payload ends with it. It is there until the next byte is taken.
    pub fn push(&mut self, byte: u8) -> bool {
        if byte != 0 {
            if let Some(place) = self.bytes.get_mut(self.count) {
                *place = byte;
            }
            self.count = self.count.saturating_add(1);
            return false;
        }
        let count = core::mem::take(&mut self.count);
        // Zeros one after the other separate nothing.
        if count == 0 {
            return false;
        }
        let length = self.bytes.get_mut(..count).and_then(|frame| cobs::decode_in_place(frame).ok());
        let checked = length.and_then(|length| self.bytes.get(..length));
        let split = checked.and_then(<[u8]>::split_last_chunk::<CHECKSUM>);
        match split.filter(|(payload, sum)| Checksum::of(payload).to_le_bytes() == **sum) {
            Some((payload, _)) => self.payload = payload.len(),
            None => {
                self.damaged = self.damaged.wrapping_add(1);
                return false;
            }
        }
        true
    }

    /// The payload that has just come.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        self.bytes.get(..self.payload).unwrap_or_default()
    }
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}
