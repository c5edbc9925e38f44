//! Which row of the manual's tables a mnemonic belongs to.

/// Rows of tables 3-1, 3-2 and 7-1 that cost alike and stall alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Row {
    /// Data processing with one result.
    Data,
    /// Data processing with two results: the long multiplies.
    LongMultiply,
    /// Sets flags only.
    Compare,
    /// Neither result nor memory.
    Hint,
    Divide,
    IfThen,
    Branch,
    Call,
    TableBranch,
    /// One register from memory. The exclusive stores too, which 3.3.2 treats as loads.
    Load,
    Store,
    /// Two core registers, from or to memory.
    Double,
    /// A list of registers, core or float, from or to memory.
    Multiple,
    /// Special registers and the interrupt mask.
    Special,
    Barrier,
    InstructionBarrier,
    /// Arithmetic of floats.
    Float,
    FloatAccumulate,
    FloatDivide,
    FloatCompare,
    /// Copies of floats, a change of sign included: not arithmetic (7.2.6).
    FloatMove,
    FloatStatus,
    /// One float register, from or to memory.
    FloatTransfer,
}

/// The row of a mnemonic as a disassembler prints it, with or without suffixes of condition, flags, width
/// and type. None if no table has it.
pub(super) fn row(mnemonic: &str) -> Option<Row> {
    const CONDITIONS: [&str; 17] = [
        "eq", "ne", "cs", "hs", "cc", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le", "al",
    ];
    let (base, suffix) = mnemonic.split_once('.').unwrap_or((mnemonic, ""));
    // The M4 has no arithmetic of doubles.
    if suffix.contains("f64") {
        return None;
    }
    if let Some(rest) = base.strip_prefix("it").filter(|rest| rest.len() <= 3) {
        return rest.bytes().all(|b| b == b't' || b == b'e').then_some(Row::IfThen);
    }
    // The whole name first: `mls` is no conditional. Conditions before flags: `bls` is `b`, not `bl`.
    let unconditional = CONDITIONS.iter().find_map(|condition| base.strip_suffix(condition));
    [Some(base), unconditional, base.strip_suffix('s'), unconditional.and_then(|name| name.strip_suffix('s'))]
        .into_iter()
        .flatten()
        .find_map(named)
}

/// The row of a mnemonic without suffixes.
#[rustfmt::skip]
fn named(name: &str) -> Option<Row> {
    Some(match name {
        // Table 3-1.
        "adc" | "add" | "addw" | "adr" | "and" | "asr" | "bfc" | "bfi" | "bic" | "clz" | "eor" | "lsl" | "lsr"
        | "mla" | "mls" | "mov" | "movt" | "movw" | "mul" | "mvn" | "neg" | "orn" | "orr" | "rbit" | "rev"
        | "rev16" | "revsh" | "ror" | "rrx" | "rsb" | "sbc" | "sbfx" | "ssat" | "sub" | "subw" | "sxtb" | "sxth"
        | "ubfx" | "usat" | "uxtb" | "uxth" => Row::Data,
        "cmn" | "cmp" | "teq" | "tst" => Row::Compare,
        "smlal" | "smull" | "umlal" | "umull" => Row::LongMultiply,
        "sdiv" | "udiv" => Row::Divide,
        "ldr" | "ldrb" | "ldrh" | "ldrsb" | "ldrsh" | "ldrt" | "ldrbt" | "ldrht" | "ldrsbt" | "ldrsht"
        | "ldrex" | "ldrexb" | "ldrexh" | "strex" | "strexb" | "strexh" => Row::Load,
        "str" | "strb" | "strh" | "strt" | "strbt" | "strht" => Row::Store,
        "ldrd" | "strd" => Row::Double,
        "ldm" | "ldmia" | "ldmdb" | "stm" | "stmia" | "stmdb" | "push" | "pop" => Row::Multiple,
        "b" | "bx" | "cbz" | "cbnz" => Row::Branch,
        "bl" | "blx" => Row::Call,
        "tbb" | "tbh" => Row::TableBranch,
        "cpsid" | "cpsie" | "mrs" | "msr" => Row::Special,
        "clrex" | "nop" | "sev" => Row::Hint,
        "dmb" | "dsb" => Row::Barrier,
        "isb" => Row::InstructionBarrier,
        // Table 3-2.
        "smmla" | "smmlar" | "smmls" | "smmlsr" | "smmul" | "smmulr"
        | "smlabb" | "smlabt" | "smlatb" | "smlatt" | "smlawb" | "smlawt" | "smlad" | "smladx" | "smlsd"
        | "smlsdx" | "smulbb" | "smulbt" | "smultb" | "smultt" | "smulwb" | "smulwt" | "smuad" | "smuadx"
        | "smusd" | "smusdx" | "ssat16" | "usat16" | "pkhbt" | "pkhtb" | "sxtb16" | "uxtb16" | "uxtab"
        | "uxtab16" | "uxtah" | "sxtab" | "sxtab16" | "sxtah" | "sel" | "usad8" | "usada8"
        | "qadd" | "qdadd" | "qsub" | "qdsub"
        | "qadd8" | "qadd16" | "qsub8" | "qsub16" | "qasx" | "qsax"
        | "sadd8" | "sadd16" | "ssub8" | "ssub16" | "sasx" | "ssax"
        | "shadd8" | "shadd16" | "shsub8" | "shsub16" | "shasx" | "shsax"
        | "uadd8" | "uadd16" | "usub8" | "usub16" | "uasx" | "usax"
        | "uhadd8" | "uhadd16" | "uhsub8" | "uhsub16" | "uhasx" | "uhsax"
        | "uqadd8" | "uqadd16" | "uqsub8" | "uqsub16" | "uqasx" | "uqsax" => Row::Data,
        "smlalbb" | "smlalbt" | "smlaltb" | "smlaltt" | "smlald" | "smlaldx" | "smlsld" | "smlsldx"
        | "umaal" => Row::LongMultiply,
        // Table 7-1.
        "vadd" | "vsub" | "vmul" | "vnmul" | "vcvt" | "vcvtr" | "vcvtb" | "vcvtt" => Row::Float,
        "vmla" | "vmls" | "vnmla" | "vnmls" | "vfma" | "vfms" | "vfnma" | "vfnms" => Row::FloatAccumulate,
        "vdiv" | "vsqrt" => Row::FloatDivide,
        "vcmp" | "vcmpe" => Row::FloatCompare,
        "vabs" | "vneg" | "vmov" => Row::FloatMove,
        "vmrs" | "vmsr" => Row::FloatStatus,
        "vldr" | "vstr" => Row::FloatTransfer,
        "vldm" | "vldmia" | "vldmdb" | "vstm" | "vstmia" | "vstmdb" | "vpush" | "vpop" => Row::Multiple,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suffixes_do_not_hide_the_name() {
        for (mnemonic, expected) in [
            ("b", Row::Branch),
            ("bls", Row::Branch),
            ("ble.w", Row::Branch),
            ("blt", Row::Branch),
            ("blls", Row::Call),
            ("bics", Row::Data),
            ("lsls", Row::Data),
            ("mls", Row::Data),
            ("movs", Row::Data),
            ("movseq.w", Row::Data),
            ("muls", Row::Data),
            ("teq", Row::Compare),
            ("smlal", Row::LongMultiply),
            ("vmls.f32", Row::FloatAccumulate),
            ("vcvt.s32.f32", Row::Float),
            ("vcmpegt.f32", Row::FloatCompare),
            ("it", Row::IfThen),
            ("ittet", Row::IfThen),
        ] {
            assert_eq!(row(mnemonic), Some(expected), "{mnemonic}");
        }
    }

    #[test]
    fn what_no_table_prices_has_no_row() {
        // Their time is that of an exception, of an event, or not of this processor.
        for mnemonic in ["svc", "bkpt", "udf", "wfi", "wfe", "vadd.f64", "vrintz.f32", ".byte", "itx", ""] {
            assert_eq!(row(mnemonic), None, "{mnemonic}");
        }
    }
}
