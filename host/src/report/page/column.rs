//! Numbers of a page as bytes that compress well.
//!
//! A column is a list of whole numbers of steps. What is written are its differences, the first, second or third ones,
//! whichever are smallest; as numbers without a sign, all lowest bytes first, then all second ones, and so on. All of it
//! wraps, so the browser gets back the very numbers.

use serde::Serialize;

/// Where a column stands among the bytes, and how it is read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Column {
    name: String,
    /// Its first byte.
    offset: usize,
    count: usize,
    /// Bytes of a number.
    planes: usize,
    /// How many times differences were taken.
    order: usize,
    /// What a number stands for, in the quantity's unit.
    step: f64,
}

/// Greatest order of differences.
const ORDER_MAX: usize = 3;

/// Appends a column.
pub(super) fn write(bytes: &mut Vec<u8>, name: String, step: f64, numbers: &[i32]) -> Column {
    let mut differences = numbers.to_vec();
    let (mut best, mut order) = (differences.clone(), 0);
    for tried in 1..=ORDER_MAX {
        differentiate(&mut differences);
        if size(&differences) < size(&best) {
            (best, order) = (differences.clone(), tried);
        }
    }
    let unsigned: Vec<u32> = best.into_iter().map(zigzag).collect();
    let most = unsigned.iter().copied().max().unwrap_or(0);
    let planes = (32 - most.leading_zeros()).div_ceil(8) as usize;
    let column = Column { name, offset: bytes.len(), count: numbers.len(), planes, order, step };
    for plane in 0..planes {
        bytes.extend(unsigned.iter().map(|number| (number >> (8 * plane)) as u8));
    }
    column
}

fn differentiate(numbers: &mut [i32]) {
    let mut before = 0;
    for number in numbers {
        (before, *number) = (*number, number.wrapping_sub(before));
    }
}

/// About how many bits all of them take.
fn size(numbers: &[i32]) -> u64 {
    numbers.iter().map(|&number| u64::from(32 - zigzag(number).leading_zeros())).sum()
}

/// 0, −1, 1, −2, … as 0, 1, 2, 3, …
fn zigzag(number: i32) -> u32 {
    ((number << 1) ^ (number >> 31)) as u32
}

#[cfg(test)]
pub(super) mod tests {
    use motion_tests::random::Random;
    use serde_json::{Value, to_value};

    use super::*;

    /// As the page's `data.js` does it, from what the header says.
    pub(in crate::report::page) fn read(bytes: &[u8], column: &Value) -> Vec<i32> {
        let [offset, count, planes, order] = ["offset", "count", "planes", "order"]
            .map(|key| column[key].as_u64().expect("a number") as usize);
        let mut numbers = vec![0u32; count];
        for plane in 0..planes {
            let at = offset + plane * count;
            for (number, &byte) in numbers.iter_mut().zip(&bytes[at..at + count]) {
                *number |= u32::from(byte) << (8 * plane);
            }
        }
        let mut numbers: Vec<i32> =
            numbers.into_iter().map(|number| (number >> 1) as i32 ^ -((number & 1) as i32)).collect();
        for _ in 0..order {
            let mut sum = 0i32;
            for number in &mut numbers {
                sum = sum.wrapping_add(*number);
                *number = sum;
            }
        }
        numbers
    }

    #[test]
    fn every_number_comes_back() {
        let mut random = Random::of_stream(21);
        let noise: Vec<i32> = (0..1000).map(|_| random.bits() as i32).collect();
        let parabola: Vec<i32> = (0..1000).map(|i| i * i * 300).collect();
        for numbers in [&[][..], &[i32::MIN, i32::MAX, 0, -1], &[7; 100], &noise, &parabola] {
            let mut bytes = vec![9; 3];
            let column = write(&mut bytes, "x".to_owned(), 0.5, numbers);
            assert_eq!(read(&bytes, &to_value(&column).expect("JSON")), numbers);
            assert_eq!(bytes.len(), 3 + column.planes * numbers.len());
        }
        let mut bytes = Vec::new();
        assert_eq!(write(&mut bytes, String::new(), 1.0, &parabola).planes, 2);
    }
}
