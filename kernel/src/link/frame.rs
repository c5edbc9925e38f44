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

    /// With `message` behind it; `None` if it is too long.
    pub(super) fn then<T: serde::Serialize>(mut self, message: &T) -> Option<Self> {
        let room = self.bytes.get_mut(self.length..PAYLOAD_MAX)?;
        self.length += postcard::to_slice(message, room).ok()?.len();
        Some(self)
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

/// Decodes COBS without its zero in place; how many bytes it was, or none if it is none. `cobs`' own decoder can panic as far
/// as a compiler sees.
fn decode(frame: &mut [u8]) -> Option<usize> {
    let (mut from, mut to) = (0, 0);
    // Bounded: each round takes a byte at least.
    while let Some(&code) = frame.get(from) {
        from += 1;
        for _ in 1..code {
            *frame.get_mut(to)? = *frame.get(from)?;
            (from, to) = (from + 1, to + 1);
        }
        if code != u8::MAX && from < frame.len() {
            *frame.get_mut(to)? = 0;
            to += 1;
        }
    }
    Some(to)
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
        let length = self.bytes.get_mut(..count).and_then(decode);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![0; FRAME_MAX];
        let length = cobs::encode(payload, &mut frame);
        frame.truncate(length);
        frame
    }

    /// Whatever comes: frames, some with a byte changed, and bytes at random; runs without a zero are the longest here.
    #[test]
    fn cobs_is_decoded_as_by_its_crate() {
        let mut state = 1_u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % below) as usize
        };
        let mut decoded = [0; 2];
        for round in 0..20_000 {
            let zeros = [2, 20, 2000][random(3)];
            let payload: Vec<u8> = (0..random(CHECKED_MAX as u64))
                .map(|_| if random(zeros) == 0 { 0 } else { 1 + random(255) as u8 })
                .collect();
            let mut frame = if round % 2 == 0 { encoded(&payload) } else { payload };
            if round % 4 == 0 && !frame.is_empty() {
                let at = random(frame.len() as u64);
                frame[at] = 1 + random(255) as u8;
            }
            frame.retain(|&byte| byte != 0);
            let mut other = frame.clone();
            // The crate takes nothing for an error.
            let (found, expected) = (
                decode(&mut frame),
                cobs::decode_in_place(&mut other).ok().or(other.is_empty().then_some(0)),
            );
            assert_eq!(found, expected, "round {round}");
            let length = found.unwrap_or_default();
            assert_eq!(frame[..length], other[..length], "round {round}");
            decoded[usize::from(found.is_some())] += 1;
        }
        assert!(decoded[0] > 1000 && decoded[1] > 6000, "{decoded:?}");
    }
}
