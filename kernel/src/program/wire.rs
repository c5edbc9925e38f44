//! A reader of the [postcard](https://postcard.jamesmunns.com) wire format that takes little flash.
//!
//! Consumes bytes; produces a program's entries through serde's derives. Background. It accepts what
//! `postcard` itself accepts, but does not return an error at every number: a missing or malformed number
//! reads as 0, is noted, and makes the whole entry `None` at its end. Every entry has a bounded number of
//! numbers. That saves a branch and an early return at each of them, which would be most of a reader's code.

use serde::de::value::U32Deserializer;
use serde::de::{self, DeserializeSeed, Deserializer, IntoDeserializer, Visitor};

/// A value at the start of `bytes`, and the bytes after it; `None` if there is none.
// In its caller's stack frame: a header is a kilobyte, and the smallest core has no room for two.
#[inline(always)]
pub(crate) fn take<'de, T: de::Deserialize<'de>>(bytes: &'de [u8]) -> Option<(T, &'de [u8])> {
    let mut wire = Wire { left: bytes, is_sound: true };
    let value = T::deserialize(&mut wire).ok()?;
    wire.is_sound.then_some((value, wire.left))
}

/// The bytes not read yet.
struct Wire<'de> {
    left: &'de [u8],
    /// All numbers so far were sound.
    is_sound: bool,
}

// Not inlined: each is in the image once.
impl Wire<'_> {
    #[inline(never)]
    fn byte(&mut self) -> u8 {
        let Some((&byte, left)) = self.left.split_first() else {
            self.is_sound = false;
            return 0;
        };
        self.left = left;
        byte
    }

    #[inline(never)]
    fn f64(&mut self) -> f64 {
        let Some((&bytes, left)) = self.left.split_first_chunk() else {
            self.is_sound = false;
            return 0.0;
        };
        self.left = left;
        f64::from_le_bytes(bytes)
    }

    /// An unsigned number of at most `bits` bits: seven in a byte, the least significant first, the eighth
    /// says that another byte follows.
    #[inline(never)]
    fn unsigned(&mut self, bits: u32) -> u64 {
        let mut value = 0;
        for shift in (0..bits).step_by(7) {
            let byte = self.byte();
            value |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                let room = bits - shift;
                self.is_sound &= room >= 7 || byte >> room == 0;
                return value;
            }
        }
        self.is_sound = false;
        0
    }

    /// A signed number, whose sign is the least significant bit.
    #[inline(never)]
    fn signed(&mut self, bits: u32) -> i64 {
        let value = self.unsigned(bits);
        (value >> 1).cast_signed() ^ -((value & 1).cast_signed())
    }
}

/// The error of a malformed entry.
#[derive(Debug)]
struct Malformed;

impl core::fmt::Display for Malformed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("malformed")
    }
}

impl de::StdError for Malformed {}

impl de::Error for Malformed {
    fn custom<T: core::fmt::Display>(_: T) -> Self {
        Self
    }
}

impl<'de> Deserializer<'de> for &mut Wire<'de> {
    type Error = Malformed;

    // The format is not self-describing.
    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Malformed> {
        Err(Malformed)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        match self.byte() {
            0 => visitor.visit_bool(false),
            1 => visitor.visit_bool(true),
            _ => Err(Malformed),
        }
    }

    fn deserialize_i16<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        // Of 16 bits, or unsound.
        #[allow(clippy::cast_possible_truncation)]
        visitor.visit_i16(self.signed(16) as i16)
    }

    fn deserialize_i64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        visitor.visit_i64(self.signed(64))
    }

    fn deserialize_u16<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        // Of 16 bits, or unsound.
        #[allow(clippy::cast_possible_truncation)]
        visitor.visit_u16(self.unsigned(16) as u16)
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        // Of 32 bits, or unsound.
        #[allow(clippy::cast_possible_truncation)]
        visitor.visit_u32(self.unsigned(32) as u32)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        visitor.visit_u64(self.unsigned(64))
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        visitor.visit_f64(self.f64())
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Malformed> {
        match self.byte() {
            0 => visitor.visit_none(),
            1 => visitor.visit_some(self),
            _ => Err(Malformed),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Malformed> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Malformed> {
        visitor.visit_seq(Sequence { wire: self, left: length })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Malformed> {
        self.deserialize_tuple(fields.len(), visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Malformed> {
        visitor.visit_enum(self)
    }

    // Types that no program has.
    serde::forward_to_deserialize_any! {
        i8 i32 i128 u8 u128 f32 char str string bytes byte_buf unit unit_struct seq tuple_struct map
        identifier ignored_any
    }
}

/// Elements or fields, one after the other.
struct Sequence<'a, 'de> {
    wire: &'a mut Wire<'de>,
    left: usize,
}

impl<'de> de::SeqAccess<'de> for Sequence<'_, 'de> {
    type Error = Malformed;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Malformed> {
        let Some(left) = self.left.checked_sub(1) else { return Ok(None) };
        self.left = left;
        seed.deserialize(&mut *self.wire).map(Some)
    }
}

impl<'de> de::EnumAccess<'de> for &mut Wire<'de> {
    type Error = Malformed;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Malformed> {
        #[allow(clippy::cast_possible_truncation)]
        let index: U32Deserializer<Malformed> = (self.unsigned(32) as u32).into_deserializer();
        Ok((seed.deserialize(index)?, self))
    }
}

impl<'de> de::VariantAccess<'de> for &mut Wire<'de> {
    type Error = Malformed;

    fn unit_variant(self) -> Result<(), Malformed> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Malformed> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Malformed> {
        self.deserialize_tuple(length, visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Malformed> {
        self.deserialize_tuple(fields.len(), visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{BedInverse, DriveInverse, Table};
    use crate::program::{Header, Item};
    use crate::random::Random;

    fn bytes_of<T: serde::Serialize>(value: &T) -> Vec<u8> {
        let mut buffer = [0; 4096];
        postcard::to_slice(value, &mut buffer).expect("short").to_vec()
    }

    /// As `postcard` reads it: the same value, down to the bits, and the same rest, or none.
    fn is_postcards<'de, T: de::Deserialize<'de> + serde::Serialize>(bytes: &'de [u8]) -> bool {
        let expected =
            postcard::take_from_bytes::<T>(bytes).ok().map(|(value, rest)| (bytes_of(&value), rest));
        let found = take::<T>(bytes).map(|(value, rest)| (bytes_of(&value), rest));
        assert_eq!(found, expected, "{bytes:02x?}");
        found.is_some()
    }

    /// Random bytes, most of which are near those of an entry: with few kinds of it at the start, numbers of
    /// all lengths, too long ones, and cut anywhere.
    #[test]
    fn reads_what_postcard_reads_and_nothing_else() {
        for seed in 1..=20 {
            let random = Random::new(seed);
            let (mut accepted, mut refused) = (0, 0);
            for _ in 0..20_000 {
                let mut bytes = vec![random.below(8) as u8];
                for _ in 0..random.below(260) {
                    let byte = random.next() as u8;
                    let long = if random.below(4) > 0 { byte | 0x80 } else { byte & 0x7F };
                    let small = byte & 1;
                    bytes.push([byte, long, small, 0xFF][random.below(4) as usize]);
                }
                let is_accepted = [
                    is_postcards::<Item<2>>(&bytes),
                    is_postcards::<Option<Table>>(&bytes),
                    is_postcards::<Option<DriveInverse>>(&bytes),
                    is_postcards::<(i64, u32, i16, u64)>(bytes.get(1..).unwrap_or_default()),
                ];
                for is_accepted in is_accepted {
                    *(if is_accepted { &mut accepted } else { &mut refused }) += 1;
                }
            }
            assert!(accepted > 10_000 && refused > 10_000, "seed {seed}: {accepted} {refused}");
        }
    }

    /// Ends of every number, and a whole header cut at every byte.
    #[test]
    fn reads_numbers_at_their_ends() {
        for number in [0, 1, 63, 64, 8191, 8192, i64::MAX, -1, -64, -65, i64::MIN] {
            let bytes = bytes_of(&number);
            assert!(is_postcards::<i64>(&bytes) && take::<i64>(&bytes) == Some((number, &[][..])));
        }
        let bed = Some(BedInverse { frequency_hz: f64::NAN, damping_ratio: -0.0, mass_ratio: f64::INFINITY });
        let drive = DriveInverse {
            velocity_gain_per_s: 1.0,
            integral_time_s: 2.0,
            current_lag_s: 3.0,
            viscous_friction_per_s: 4.0,
            coulomb_friction_mm_s2: 5.0,
            reversal_mm_s: 6.0,
            bed,
        };
        let bytes = bytes_of(&Some(drive));
        for length in 0..=bytes.len() {
            let is_whole = length == bytes.len();
            assert_eq!(is_postcards::<Option<DriveInverse>>(bytes.get(..length).expect("within")), is_whole);
        }
        assert!(take::<Header<2>>(&[0; 64]).is_none());
    }
}
