//! One line of disassembly: its row in the tables, its width, and the registers that decide about stalls.

use std::fmt;

use super::mnemonic::{Row, row};

/// A set of registers. Bits 0 to 15 are core registers, 16 to 47 single floats, 48 the float flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Registers(u64);

impl Registers {
    const NONE: Self = Self(0);
    const SP: Self = Self(1 << 13);
    const PC: Self = Self(1 << 15);
    const FLOAT_FLAGS: Self = Self(1 << 48);
    const CORE: Self = Self(0xffff);

    pub(super) fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    pub(super) fn count(self) -> u32 {
        self.0.count_ones()
    }

    /// Every register named in `text`.
    fn named_in(text: &str) -> Self {
        let names = text.split(|c: char| !c.is_ascii_alphanumeric());
        Self(names.fold(0, |all, name| all | Self::named(name).0))
    }

    fn named(name: &str) -> Self {
        let number = |limit: u32| name.get(1..)?.parse().ok().filter(|&n: &u32| n < limit);
        match name {
            "sb" => Self(1 << 9),
            "sl" => Self(1 << 10),
            "fp" => Self(1 << 11),
            "ip" => Self(1 << 12),
            "sp" => Self::SP,
            "lr" => Self(1 << 14),
            "pc" => Self::PC,
            "fpscr" => Self::FLOAT_FLAGS,
            _ => match name.as_bytes().first() {
                Some(b'r') => number(16).map_or(Self::NONE, |n| Self(1 << n)),
                Some(b's') => number(32).map_or(Self::NONE, |n| Self(1 << (16 + n))),
                Some(b'd') => number(16).map_or(Self::NONE, |n| Self(3 << (16 + 2 * n))),
                _ => Self::NONE,
            },
        }
    }
}

/// What the price of an instruction depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    pub(super) row: Row,
    /// Bytes, 2 or 4.
    pub(super) width: u32,
    /// Registers it writes. Of pairs and lists also those it stores: what stalls after it does not ask.
    pub(super) results: Registers,
    /// Registers it needs when it starts. The addend of an accumulate is not: it comes one cycle later
    /// (7.2.3).
    pub(super) sources: Registers,
    /// Registers its address is made of.
    pub(super) address: Registers,
    /// Words it moves from or to memory, if a list or a pair.
    pub(super) words: u32,
    /// Bytes from the program counter, a multiple of 4, to what it loads, if that is a constant beside the code.
    pub(super) constant: Option<i32>,
    /// Moves a float register whole from or to core registers.
    pub(super) between_files: bool,
}

impl Instruction {
    /// Reads what a disassembler prints, such as `ldr.w r0, [r1, #4]`, for an instruction of `width` bytes.
    ///
    /// # Errors
    /// No table has the instruction, or its operands are written in a way not known here.
    pub fn parse(text: &str, width: u32) -> Result<Self, UnknownInstruction> {
        let unknown = || UnknownInstruction { text: text.to_owned() };
        let (mnemonic, operands) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let row = row(mnemonic).ok_or_else(unknown)?;
        let list = between(operands, '{', '}');
        // A range would be counted as its two ends.
        if list.contains('-') {
            return Err(unknown());
        }
        let (first, rest) = operands.split_once(',').unwrap_or((operands, ""));
        let second = rest.split(',').next().unwrap_or_default();
        let all = Registers::named_in(operands);
        let [first, second, list] = [first, second, list].map(Registers::named_in);

        let words = match row {
            Row::Multiple => list.count(),
            Row::FloatTransfer => first.count(),
            Row::Double => 2,
            _ => 0,
        };
        if row == Row::Multiple && words == 0 {
            return Err(unknown());
        }
        let results = match row {
            Row::LongMultiply | Row::Double => Registers(first.0 | second.0),
            Row::FloatCompare => Registers::FLOAT_FLAGS,
            Row::Branch | Row::Call | Row::TableBranch => Registers::PC,
            Row::Multiple => list,
            Row::Compare | Row::Hint | Row::IfThen | Row::Store | Row::Barrier => Registers::NONE,
            _ => first,
        };
        let sources = match row {
            Row::Float | Row::FloatAccumulate | Row::FloatDivide | Row::FloatMove => {
                Registers::named_in(rest)
            }
            _ => all,
        };
        let constant = constant(between(operands, '[', ']')).map_err(|()| unknown())?;
        let address = match (row, mnemonic.contains("push") || mnemonic.contains("pop")) {
            (Row::Multiple, true) => Registers::SP,
            (Row::Multiple, false) => first,
            _ => Registers::named_in(between(operands, '[', ']')),
        };
        // Half of a double is written `d0[1]` and costs less (table 7-1).
        let between_files = row == Row::FloatMove && all.meets(Registers::CORE) && !operands.contains('[');
        Ok(Self { row, width, results, sources, address, words, constant, between_files })
    }

    /// Whether it may continue elsewhere than at the next instruction.
    pub(super) fn may_jump(&self) -> bool {
        self.results.meets(Registers::PC)
    }

    /// Whether it leaves a return address.
    pub(super) fn is_call(&self) -> bool {
        self.row == Row::Call
    }

    pub(super) fn is_literal(&self) -> bool {
        self.address.meets(Registers::PC)
    }

    /// The address of the constant that it loads where it stands at `at`. A table of jumps begins there.
    pub(super) fn constant_at(&self, at: u32) -> Option<u32> {
        self.constant.map(|bytes| (at.wrapping_add(4) & !3).wrapping_add_signed(bytes))
    }
}

/// The offset of `pc, #0x10`; none if the address is made of other registers.
fn constant(address: &str) -> Result<Option<i32>, ()> {
    let Some(rest) = address.strip_prefix("pc") else { return Ok(None) };
    let Some(offset) = rest.trim_start_matches([',', ' ']).strip_prefix('#') else { return Ok(Some(0)) };
    let (sign, digits) = offset.strip_prefix('-').map_or((1, offset), |digits| (-1, digits));
    let bytes = digits.strip_prefix("0x").map_or_else(|| digits.parse(), |hex| i32::from_str_radix(hex, 16));
    bytes.map(|bytes| Some(sign * bytes)).map_err(|_| ())
}

/// What stands between two brackets, or nothing.
fn between(text: &str, open: char, close: char) -> &str {
    text.split_once(open).and_then(|(_, rest)| rest.split_once(close)).map_or("", |(inner, _)| inner)
}

/// An instruction without a price.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownInstruction {
    /// As the disassembler printed it.
    pub text: String,
}

impl fmt::Display for UnknownInstruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no price for the instruction `{}`", self.text)
    }
}

impl std::error::Error for UnknownInstruction {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_have_one_bit_for_each_word() {
        assert_eq!(Registers::named_in("r0, [sb, #0x10]"), Registers(1 | 1 << 9));
        assert_eq!(Registers::named_in("{s0, d1}").count(), 3);
        assert_eq!(Registers::named_in("d0"), Registers::named_in("s0, s1"));
        assert_eq!(Registers::named_in("apsr_nzcv, fpscr"), Registers::FLOAT_FLAGS);
        assert_eq!(Registers::named_in("#0x8a0, lsl #3, r16, s32, sy"), Registers::NONE);
    }

    #[test]
    fn words_are_counted_in_lists() {
        let words = |text| Instruction::parse(text, 4).unwrap().words;
        assert_eq!(words("ldm r0!, {r1, r2, r3}"), 3);
        assert_eq!(words("vpush {d8, d9}"), 4);
        assert_eq!(words("vstr d0, [sp]"), 2);
        assert_eq!(words("vldr s0, [sp]"), 1);
    }

    #[test]
    fn constants_lie_beside_the_code() {
        let at = |text, at| Instruction::parse(text, 4).unwrap().constant_at(at);
        assert_eq!(at("ldr r0, [pc, #8]", 0x102), Some(0x10c));
        assert_eq!(at("vldr d0, [pc, #-0x10]", 0x200), Some(0x1f4));
        assert_eq!(at("tbh [pc, r2, lsl #1]", 0x200), Some(0x204));
        assert_eq!(at("ldr r0, [r1, #8]", 0x102), None);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for text in ["svc #0", "push {r4-r7}", "push", ".byte 0x00, 0xf0", ""] {
            let error = Instruction::parse(text, 2).unwrap_err();
            assert_eq!(error.text, text);
            assert!(error.to_string().contains(text));
        }
    }

    #[test]
    fn what_writes_the_program_counter_may_jump() {
        for text in ["b #4", "bx lr", "pop {r4, pc}", "ldr pc, [r0]", "mov pc, r0", "tbb [pc, r0]"] {
            assert!(Instruction::parse(text, 4).unwrap().may_jump(), "{text}");
        }
        for text in ["ldr r0, [pc, #4]", "push {r4, lr}", "add r0, pc, #4", "str r0, [r1]", "cmp r0, #1"] {
            assert!(!Instruction::parse(text, 4).unwrap().may_jump(), "{text}");
        }
    }
}
