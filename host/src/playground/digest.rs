//! A number for all bits of a run, which two builds have in common or not.

use crate::trace::TraceRow;

/// FNV-1a over 64 bits at a time.
pub(super) struct Digest(u64);

impl Digest {
    pub(super) fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bits: u64) {
        self.0 = (self.0 ^ bits).wrapping_mul(0x0000_0100_0000_01b3);
        // The product leaves low bits where they were.
        self.0 ^= self.0 >> 32;
    }

    pub(super) fn number(&mut self, number: f64) {
        self.add(number.to_bits());
    }

    /// A tick: motion along the path, and of every axis what was commanded, read, and put out.
    pub(super) fn row<const N: usize>(&mut self, row: &TraceRow<N>) {
        self.add(row.tick);
        self.add(u64::from(row.line));
        let along = [row.s_mm, row.v_mm_s, row.a_mm_s2, row.j_mm_s3, row.snap_mm_s4, row.contour_um];
        along.into_iter().for_each(|number| self.number(number));
        for axis in &row.axes {
            let of_axis = [
                axis.set_mm,
                axis.vel_mm_s,
                axis.acc_mm_s2,
                axis.jerk_mm_s3,
                axis.act_mm,
                axis.err_um,
                axis.out_v,
            ];
            of_axis.into_iter().for_each(|number| self.number(number));
        }
    }

    /// In sixteen letters.
    pub(super) fn words(&self) -> String {
        format!("{:016x}", self.0)
    }
}
