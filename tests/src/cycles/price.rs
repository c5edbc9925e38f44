//! The price of one executed instruction.

use super::Cost;
use super::instruction::Instruction;
use super::mnemonic::Row;

/// P, the refill of the pipeline, is 1 to 3 by the target's alignment and width and by whether the address
/// was speculated early (3.3.1).
const REFILL: Cost = cost(2, 3);
/// A load into the PC always waits for the whole refill (3.3.2).
const REFILL_AFTER_LOAD: Cost = cost(3, 3);

const fn cost(nominal: u32, pessimistic: u32) -> Cost {
    Cost { nominal, pessimistic }
}

/// Estimated cycles of an instruction that was executed after `previous`; `taken` if execution went on
/// elsewhere than at the next instruction.
#[must_use]
pub fn price(instruction: &Instruction, taken: bool, previous: Option<&Instruction>) -> Cost {
    let words = instruction.words;
    // Contention with the fetch unit: 3.3.2 says it might.
    let literal = cost(0, u32::from(instruction.is_literal()));
    let cycles = match instruction.row {
        Row::Data | Row::LongMultiply | Row::Compare | Row::Hint | Row::Branch | Row::Call => cost(1, 1),
        // Note a: 2 to 12 by the operands, of which a trace knows nothing.
        Row::Divide => cost(7, 12),
        // Note d: folded onto an instruction of 16 bits.
        Row::IfThen => cost(u32::from(previous.is_none_or(|previous| previous.width != 2)), 1),
        // 3.3.2 gives at least 6, more than the 2 + P of table 3-1; the refill is among them.
        Row::TableBranch => cost(6, 6),
        Row::Load => cost(if follows_load(instruction, previous) && !taken { 1 } else { 2 }, 2) + literal,
        // 3.3.2: with an immediate offset always 1. The other side is for a write buffer in use.
        Row::Store => {
            let one = instruction.address.count() == 1 || follows_load(instruction, previous);
            cost(if one { 1 } else { 2 }, 2)
        }
        Row::Double | Row::Multiple => cost(1 + words, 1 + words),
        Row::FloatTransfer => cost(1 + words, 1 + words) + literal,
        Row::Special => cost(1, 2),
        // 1 + B. Without wait states the write buffer is not used (3.5), so B is at most the data phase of a
        // store just before.
        Row::Barrier => cost(1, 2),
        Row::InstructionBarrier => cost(1, 1) + REFILL,
        Row::Float | Row::FloatCompare | Row::FloatStatus => cost(1, 1),
        Row::FloatMove if instruction.between_files => cost(2, 2),
        Row::FloatMove => cost(1, 1),
        Row::FloatAccumulate => cost(3, 3),
        Row::FloatDivide => cost(14, 14),
    };
    let refill = match instruction.row {
        _ if !taken => cost(0, 0),
        Row::TableBranch => cost(0, 0),
        Row::Load | Row::Multiple => REFILL_AFTER_LOAD,
        _ => REFILL,
    };
    let stall = u32::from(previous.is_some_and(|previous| stalls(instruction, previous)));
    cycles + refill + cost(stall, stall)
}

/// 3.3.2: a load or store after a load saves a cycle unless its address is what was loaded.
fn follows_load(instruction: &Instruction, previous: Option<&Instruction>) -> bool {
    previous.is_some_and(|load| load.row == Row::Load && !load.results.meets(instruction.address))
}

/// Whether the result of `previous` comes one cycle too late.
fn stalls(instruction: &Instruction, previous: &Instruction) -> bool {
    match previous.row {
        // 3.3.2: there is no forwarding to an address.
        Row::Data | Row::LongMultiply | Row::Divide => previous.results.meets(instruction.address),
        // 7.2.3, notes.
        Row::Float | Row::FloatAccumulate | Row::FloatDivide | Row::FloatCompare => {
            previous.results.meets(instruction.sources)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Instruction {
        Instruction::parse(text, 4).unwrap()
    }

    fn after(previous: &str, text: &str) -> Cost {
        price(&parse(text), false, Some(&parse(previous)))
    }

    #[test]
    fn every_row_of_the_tables() {
        for (text, nominal, pessimistic) in [
            ("movs r0, #0", 1, 1),
            ("mla r0, r1, r2, r3", 1, 1),
            ("smmul r0, r1, r2", 1, 1),
            ("umlal r0, r1, r2, r3", 1, 1),
            ("cmp r0, r1", 1, 1),
            ("nop", 1, 1),
            ("sdiv r0, r1, r2", 7, 12),
            ("ite eq", 1, 1),
            ("ldr r0, [r1, #4]", 2, 2),
            ("ldr r0, [pc, #4]", 2, 3),
            ("ldrex r0, [r1]", 2, 2),
            ("strex r0, r1, [r2]", 2, 2),
            ("str r0, [r1, #4]", 1, 2),
            ("str r0, [r1, r2]", 2, 2),
            ("strb r0, [r1], #1", 1, 2),
            ("ldrd r0, r1, [r2]", 3, 3),
            ("strd r0, r1, [r2]", 3, 3),
            ("ldm r0!, {r1, r2, r3}", 4, 4),
            ("stm r0!, {r1}", 2, 2),
            ("push {r4, r5, lr}", 4, 4),
            ("pop {r4, r5}", 3, 3),
            ("mrs r0, primask", 1, 2),
            ("cpsid i", 1, 2),
            ("dmb sy", 1, 2),
            ("isb sy", 3, 4),
            ("vadd.f32 s0, s1, s2", 1, 1),
            ("vcvt.s32.f32 s0, s1", 1, 1),
            ("vcmp.f32 s0, #0", 1, 1),
            ("vfma.f32 s0, s1, s2", 3, 3),
            ("vdiv.f32 s0, s1, s2", 14, 14),
            ("vsqrt.f32 s0, s1", 14, 14),
            ("vneg.f32 s0, s1", 1, 1),
            ("vmov.f32 s0, #1.000000e+00", 1, 1),
            ("vmov s0, r0", 2, 2),
            ("vmov r0, r1, d0", 2, 2),
            ("vmov.32 d0[1], r0", 1, 1),
            ("vmrs apsr_nzcv, fpscr", 1, 1),
            ("vldr s0, [r0]", 2, 2),
            ("vldr s0, [pc, #4]", 2, 3),
            ("vstr d0, [r0]", 3, 3),
            ("vldmia r0, {s0, s1}", 3, 3),
            ("vpush {d8, d9}", 5, 5),
        ] {
            assert_eq!(price(&parse(text), false, None), cost(nominal, pessimistic), "{text}");
        }
    }

    #[test]
    fn a_jump_refills_the_pipeline() {
        for (text, nominal, pessimistic) in [
            ("b #8", 3, 4),
            ("cbnz r0, #8", 3, 4),
            ("bl #8", 3, 4),
            ("bx lr", 3, 4),
            ("mov pc, r0", 3, 4),
            ("ldr pc, [r0]", 5, 5),
            ("pop {r4, pc}", 6, 6),
            ("tbh [pc, r0, lsl #1]", 6, 6),
        ] {
            assert_eq!(price(&parse(text), true, None), cost(nominal, pessimistic), "{text}");
        }
        assert_eq!(price(&parse("beq #8"), false, None), cost(1, 1));
    }

    #[test]
    fn neighbouring_loads_are_pipelined_as_in_the_manual() {
        assert_eq!(after("ldr r0, [r1]", "ldr r1, [r2]"), cost(1, 2));
        assert_eq!(after("ldr r0, [r1, r2]", "str r1, [r3, r2]"), cost(1, 2));
        // The address is what was loaded; nothing follows a store; a load of the PC blocks.
        assert_eq!(after("ldr r0, [r1]", "ldr r1, [r0]"), cost(2, 2));
        assert_eq!(after("str r0, [r1]", "ldr r2, [r3]"), cost(2, 2));
        assert_eq!(price(&parse("ldr pc, [r2]"), true, Some(&parse("ldr r0, [r1]"))), cost(5, 5));
    }

    #[test]
    fn an_address_just_computed_stalls() {
        assert_eq!(after("adds r0, #4", "ldr r1, [r0]"), cost(3, 3));
        assert_eq!(after("umull r2, r0, r4, r5", "str r1, [r0]"), cost(2, 3));
        assert_eq!(after("sub sp, #8", "push {r0}"), cost(3, 3));
        assert_eq!(after("adds r2, #4", "ldr r1, [r0]"), cost(2, 2));
        assert_eq!(after("adds r1, #4", "str r1, [r0]"), cost(1, 2));
        assert_eq!(after("cmp r0, #4", "ldr r1, [r0]"), cost(2, 2));
    }

    #[test]
    fn a_float_just_computed_stalls() {
        assert_eq!(after("vmul.f32 s0, s1, s2", "vadd.f32 s3, s3, s0"), cost(2, 2));
        assert_eq!(after("vmul.f32 s0, s1, s2", "vstr s0, [r0]"), cost(3, 3));
        assert_eq!(after("vcmp.f32 s0, s1", "vmrs apsr_nzcv, fpscr"), cost(2, 2));
        assert_eq!(after("vmul.f32 s0, s1, s2", "vadd.f32 s3, s3, s4"), cost(1, 1));
        // Moves are not arithmetic, and an addend is due later.
        assert_eq!(after("vmov.f32 s0, s1", "vadd.f32 s3, s3, s0"), cost(1, 1));
        assert_eq!(after("vmul.f32 s0, s1, s2", "vfma.f32 s0, s3, s4"), cost(3, 3));
        assert_eq!(after("vmul.f32 s0, s1, s2", "vfma.f32 s3, s0, s4"), cost(4, 4));
    }

    #[test]
    fn an_it_is_folded_onto_a_short_instruction() {
        let it = Instruction::parse("it eq", 2).unwrap();
        let short = Instruction::parse("cmp r0, #1", 2).unwrap();
        assert_eq!(price(&it, false, Some(&short)), cost(0, 1));
        assert_eq!(price(&it, false, Some(&parse("cmp.w r0, #1"))), cost(1, 1));
    }
}
