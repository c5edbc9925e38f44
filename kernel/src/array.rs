//! Arrays whose length is a parameter, which serde itself does not know: as tuples, element by element,
//! without a panic path. For `#[serde(with = "motion_kernel::array")]`, of one element at least.
//!
//! ```
//! #[derive(serde::Serialize, serde::Deserialize)]
//! struct Places<const N: usize> {
//!     #[serde(with = "motion_kernel::array")]
//!     counts: [i32; N],
//! }
//!
//! let mut bytes = [0; 8];
//! let written = postcard::to_slice(&Places { counts: [1, -1, 2] }, &mut bytes)?;
//! assert_eq!(written, [2, 1, 4]);
//! let read: Places<3> = postcard::from_bytes(written)?;
//! assert_eq!(read.counts, [1, -1, 2]);
//! # Ok::<(), postcard::Error>(())
//! ```

use core::fmt;
use core::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// Writes the elements, one after the other.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<T: Serialize, S: Serializer, const N: usize>(
    array: &[T; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(N)?;
    for element in array {
        tuple.serialize_element(element)?;
    }
    tuple.end()
}

/// Reads as many elements as the array has.
///
/// # Errors
/// There are fewer, or those of the deserializer.
pub fn deserialize<'de, T: Copy + Deserialize<'de>, D: Deserializer<'de>, const N: usize>(
    deserializer: D,
) -> Result<[T; N], D::Error> {
    deserializer.deserialize_tuple(N, Elements(PhantomData))
}

struct Elements<T, const N: usize>(PhantomData<T>);

impl<'de, T: Copy + Deserialize<'de>, const N: usize> Visitor<'de> for Elements<T, N> {
    type Value = [T; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{N} elements, one at least")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[T; N], A::Error> {
        let missing = |index| Error::invalid_length(index, &"one for each axis");
        let first = sequence.next_element()?.ok_or_else(|| missing(0))?;
        let mut array = [first; N];
        for (index, place) in array.iter_mut().enumerate().skip(1) {
            *place = sequence.next_element()?.ok_or_else(|| missing(index))?;
        }
        Ok(array)
    }
}

/// Rows of such arrays.
pub mod rows {
    use serde::de::{Deserialize, Deserializer};
    use serde::ser::{Serialize, Serializer};

    /// A row.
    #[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
    struct Row<T: Copy, const N: usize>(
        #[serde(
            with = "super",
            bound(serialize = "T: serde::Serialize", deserialize = "T: serde::Deserialize<'de>")
        )]
        [T; N],
    );

    /// Writes the rows, one after the other.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<T: Copy + Serialize, S: Serializer, const N: usize, const ROWS: usize>(
        rows: &[[T; N]; ROWS],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        super::serialize(&rows.map(Row), serializer)
    }

    /// Reads as many rows as there are.
    ///
    /// # Errors
    /// There are fewer, or those of the deserializer.
    pub fn deserialize<
        'de,
        T: Copy + Deserialize<'de>,
        D: Deserializer<'de>,
        const N: usize,
        const ROWS: usize,
    >(
        deserializer: D,
    ) -> Result<[[T; N]; ROWS], D::Error> {
        super::deserialize(deserializer).map(|rows: [Row<T, N>; ROWS]| rows.map(|Row(row)| row))
    }
}
