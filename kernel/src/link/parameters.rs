//! The board's parameters over the link: read, and written while the drives are off.
//!
//! Parameters are a record of bytes to the link: a [compiled program](crate::program::write) without items. They go in pieces;
//! each is asked for, or confirmed, by its first byte, so that lost ones come again. New ones are complete where their checksum
//! is right; then the board checks them, stores them, and starts anew with them.

use super::message::{Record, WriteError};
use crate::program::Checksum;

/// New parameters on a board, with room for `BYTES`.
#[derive(Clone, Debug)]
pub struct ParameterBuffer<const BYTES: usize> {
    bytes: [u8; BYTES],
    /// What is coming, and how many bytes of it are here.
    record: Record,
    count: usize,
    error: Option<WriteError>,
    is_taken: bool,
}

impl<const BYTES: usize> ParameterBuffer<BYTES> {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        let record = Record { length: 0, sum: 0, attempt: 0 };
        Self { bytes: [0; BYTES], record, count: 0, error: None, is_taken: false }
    }

    /// The new parameters, once all of them are here; then never again.
    pub fn take(&mut self) -> Option<&[u8]> {
        let bytes = self.bytes.get(..self.record.length as usize)?;
        let is_complete = self.record.length > 0 && self.count == bytes.len() && self.error.is_none();
        if !is_complete || core::mem::replace(&mut self.is_taken, true) {
            return None;
        }
        Some(bytes)
    }

    /// The bytes that have come so far of those that came last.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.count).unwrap_or_default()
    }

    /// The new parameters are not taken.
    pub(super) fn refuse(&mut self, error: WriteError) {
        self.error = Some(error);
    }

    /// Takes bytes from `offset` on, of `record`.
    pub(super) fn put(&mut self, record: Record, offset: u32, bytes: &[u8], is_off: bool) {
        if record != self.record {
            (self.record, self.count, self.error, self.is_taken) = (record, 0, None, false);
        }
        if BYTES == 0 {
            self.error = Some(WriteError::Storage);
        } else if !is_off {
            self.error = Some(WriteError::DrivesOn);
        } else if record.length as usize > BYTES {
            self.error = Some(WriteError::Length { room: BYTES as u32 });
        }
        // A piece that came before, or one that comes too early.
        if self.error.is_some() || offset as usize != self.count {
            return;
        }
        let end = (self.count + bytes.len()).min(record.length as usize);
        let Some(place) = self.bytes.get_mut(self.count..end) else { return };
        for (place, byte) in place.iter_mut().zip(bytes) {
            *place = *byte;
        }
        self.count = end;
        let is_whole = end == record.length as usize;
        if is_whole && self.bytes.get(..end).is_none_or(|bytes| Checksum::of(bytes) != record.sum) {
            self.error = Some(WriteError::Unsuitable);
        }
    }

    /// What has come.
    pub(super) fn written(&self) -> (Record, u32, Option<WriteError>) {
        (self.record, self.count as u32, self.error)
    }
}

impl<const BYTES: usize> Default for ParameterBuffer<BYTES> {
    fn default() -> Self {
        Self::new()
    }
}
