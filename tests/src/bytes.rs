//! What compiled programs take: bytes by kind of block and of item.

use motion_host::planning::{Executable, Item as PlanItem, Plan, PlanningError};
use motion_host::toolpath::Element;
use motion_kernel::program::Item;
use motion_kernel::program::compact::Encoder;

/// Items of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// How many.
    pub items: usize,
    /// Their bytes.
    pub bytes: usize,
}

/// What straight blocks take, or curved ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OfBlocks {
    /// The number of blocks.
    pub blocks: usize,
    /// Pieces; of a line that is longer than a piece, the first.
    pub pieces: Count,
    /// The further pieces of such lines.
    pub more_pieces: Count,
    /// Limits for live control.
    pub limits: Count,
    /// Cruises that start on a piece.
    pub cruises: Count,
    /// Ramps that start on a piece.
    pub ramps: Count,
    /// What follows a piece: ends of stretches, dwells, stops, switches.
    pub others: Count,
}

impl OfBlocks {
    /// The bytes of all.
    #[must_use]
    pub fn bytes(&self) -> usize {
        [self.pieces, self.more_pieces, self.limits, self.cruises, self.ramps, self.others]
            .iter()
            .map(|count| count.bytes)
            .sum()
    }

    fn add(&mut self, other: &Self) {
        self.blocks += other.blocks;
        for (sum, count) in [
            (&mut self.pieces, other.pieces),
            (&mut self.more_pieces, other.more_pieces),
            (&mut self.limits, other.limits),
            (&mut self.cruises, other.cruises),
            (&mut self.ramps, other.ramps),
            (&mut self.others, other.others),
        ] {
            sum.items += count.items;
            sum.bytes += count.bytes;
        }
    }
}

/// What a program takes: its straight blocks and its curved ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bytes {
    /// Straight blocks.
    pub lines: OfBlocks,
    /// Arcs, blends and other curves.
    pub curves: OfBlocks,
}

impl Bytes {
    /// The bytes of a plan's items, with the blocks of live control or without.
    ///
    /// # Errors
    /// The plan can't be executed.
    pub fn of<const N: usize>(plan: &Plan<N>, is_live: bool) -> Result<Self, PlanningError> {
        let mut all = Self::default();
        let blocks = plan.items.iter().filter_map(|item| match item {
            PlanItem::Stretch(stretch) => Some(&stretch.blocks),
            _ => None,
        });
        for block in blocks.flatten() {
            all.at(!matches!(block.element, Element::Line { .. })).blocks += 1;
        }
        let mut encoder = Encoder::new();
        let mut is_curve = false;
        // The limits of a block come before its piece.
        let mut limits = Count::default();
        let mut line_before = None;
        for item in Executable::new::<f32>(plan)?.items {
            if matches!(item, Item::Block(_)) && !is_live {
                continue;
            }
            let bytes = encoder.encode(&item, &mut [0; 1000]).unwrap_or_default();
            if let Item::Block(_) = item {
                limits.items += 1;
                limits.bytes += bytes;
                continue;
            }
            let line = match item {
                Item::Line { line, direction, .. } => Some((line, direction)),
                _ => None,
            };
            if line.is_some() || matches!(item, Item::Septic { .. }) {
                is_curve = line.is_none();
            }
            let of = all.at(is_curve);
            let count = match item {
                Item::Line { .. } if limits.items == 0 && line == line_before => &mut of.more_pieces,
                Item::Line { .. } | Item::Septic { .. } => &mut of.pieces,
                Item::Feed(planned) if planned.ramp.is_cruise() => &mut of.cruises,
                Item::Feed(_) => &mut of.ramps,
                _ => &mut of.others,
            };
            count.items += 1;
            count.bytes += bytes;
            if line.is_some() || matches!(item, Item::Septic { .. }) {
                let taken = std::mem::take(&mut limits);
                of.limits.items += taken.items;
                of.limits.bytes += taken.bytes;
                line_before = line;
            }
        }
        Ok(all)
    }

    /// Adds those of another program.
    pub fn add(&mut self, other: &Self) {
        self.lines.add(&other.lines);
        self.curves.add(&other.curves);
    }

    fn at(&mut self, is_curve: bool) -> &mut OfBlocks {
        if is_curve { &mut self.curves } else { &mut self.lines }
    }
}
