//! The items of a program for a board's axes, whole or from an item on.

use motion_kernel::hal::OutputState;
use motion_kernel::num::Real;
use motion_kernel::program::{Checksum, Header, Item};
use motion_kernel::units::Position;

use crate::machine::Machine;
use crate::planning::{Problem, bytes_of, first_axes, header_of_axes, rest_of_stretch};

/// A program for a board of `M` axes.
#[derive(Clone, Debug)]
pub struct Job<const M: usize> {
    /// The machine it was planned for, and where it starts.
    pub header: Header<M>,
    /// Its items, live control's blocks among them.
    pub items: Vec<Item<M>>,
    /// Its name on the link: the checksum of machine and items, and not 0.
    pub name: u32,
    /// The checksum of the machine: that of its program without items.
    pub machine: u32,
    /// Where it begins in its program.
    pub begin: Begin<M>,
}

/// Where a job begins in its program, and what was there before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Begin<const M: usize> {
    /// The number of the program's item that it begins with.
    pub item: usize,
    /// Pieces of path and ends of stretches before it.
    pub path: u32,
    /// Program stops before it.
    pub stops: usize,
    /// What is executed before the way to its start: spindle and coolant as the program has them there, and the wait for the
    /// spindle. Nothing if they are off.
    pub lead: Vec<Item<M>>,
}

impl<const M: usize> Job<M> {
    /// The job of `items` on `machine`, which has `M` axes or fewer than `M` places behind them.
    #[must_use]
    pub fn new<const N: usize>(machine: &Machine<N>, items: &[Item<N>]) -> Self {
        Self {
            header: header_of_axes(&machine.header()),
            items: items.iter().map(first_axes).collect(),
            name: checksum(&bytes_of::<N, M>(machine, items)).max(1),
            machine: checksum(&parameters::<N, M>(machine)),
            begin: Begin::default(),
        }
    }

    /// The job of items that are planned while they are driven, with a name of its own.
    #[must_use]
    pub fn in_planning<const N: usize>(machine: &Machine<N>, name: u32) -> Self {
        Self { name: name.max(1), ..Self::new(machine, &[]) }
    }

    /// What is left of a whole job from an item on, for a kernel of the number type `R`: a job of its own, with its own name.
    /// Within a stretch it begins at rest, at the start of the piece of path that the item belongs to; the feed over the rest
    /// of the stretch is planned anew, and its first block is shorter. All other items stay as they are.
    ///
    /// # Errors
    /// There is no plan from rest; with the program line.
    pub fn from_item<R: Real>(&self, item: usize) -> Result<Self, (u32, Problem)> {
        let mut before = Before::new(self.header.start);
        let is_piece = self.items.get(item).is_some_and(|item| piece(item).is_some());
        for (number, item) in self.items.iter().enumerate().take(item + usize::from(is_piece)) {
            before.pass(number, item);
        }
        let rest = |from: usize| self.items.get(from..).unwrap_or_default().to_vec();
        let (item, path, start, items) = match before.stretch {
            Some(Stretch { first, path_before, last: Some((number, start, path)) }) if path > path_before => {
                let Header { pulse, tick_s, .. } = self.header;
                let of_stretch = rest(first);
                let length = of_stretch.iter().position(is_end).map_or(of_stretch.len(), |end| end + 1);
                let (of_stretch, behind) = of_stretch.split_at(length);
                let mut items = rest_of_stretch::<R, M>(of_stretch, number - first, pulse, tick_s)?;
                items.extend(behind);
                (number, path, start, items)
            }
            Some(Stretch { first, path_before, .. }) => (first, path_before, before.here, rest(first)),
            None => (item, before.path, before.here, rest(item)),
        };
        let name = [self.name.to_le_bytes(), (item as u32).to_le_bytes()];
        let begin = Begin { item, path, stops: before.stops, lead: before.lead() };
        let header = Header { start, ..self.header };
        Ok(Self {
            header,
            items,
            name: Checksum::of(name.as_flattened()).max(1),
            machine: self.machine,
            begin,
        })
    }

    /// The item of a whole job where so many pieces of path and ends of stretches are behind: the next piece, what comes at
    /// rest before it where that is the first of its stretch, or the end of its stretch.
    #[must_use]
    pub fn item_behind(&self, path: u32) -> usize {
        let mut before = Before::new(self.header.start);
        for (number, item) in self.items.iter().enumerate() {
            if before.path == path && (is_end(item) || piece(item).is_some()) {
                let is_first = before.stretch.is_none_or(|stretch| stretch.last.is_none());
                return if is_first { before.rest } else { number };
            }
            before.pass(number, item);
        }
        before.rest
    }

    /// The program line of the first piece of path from an item on; none behind the last one.
    #[must_use]
    pub fn line_of(&self, item: u32) -> Option<u32> {
        self.items.get(item as usize..)?.iter().find_map(piece).map(|(line, _)| line)
    }
}

/// What the items before one leave behind.
struct Before<const M: usize> {
    /// Where the last stretch ended, and the number of the item behind it.
    here: [Position; M],
    rest: usize,
    /// Pieces and ends of stretches, and program stops.
    path: u32,
    stops: usize,
    stretch: Option<Stretch<M>>,
    outputs: OutputState,
    /// The wait that follows the spindle's last switch.
    wait: Option<Item<M>>,
    is_spindle_switched: bool,
}

/// The stretch that an item is in.
#[derive(Clone, Copy)]
struct Stretch<const M: usize> {
    /// The number of its first item.
    first: usize,
    path_before: u32,
    /// Its last piece so far: its number, where it starts, and how many there are before it on the path.
    last: Option<(usize, [Position; M], u32)>,
}

impl<const M: usize> Before<M> {
    fn new(here: [Position; M]) -> Self {
        Self {
            here,
            rest: 0,
            path: 0,
            stops: 0,
            stretch: None,
            outputs: OutputState::OFF,
            wait: None,
            is_spindle_switched: false,
        }
    }

    fn pass(&mut self, number: usize, item: &Item<M>) {
        let waits = std::mem::take(&mut self.is_spindle_switched);
        match *item {
            Item::Block(_) | Item::Line { .. } | Item::Septic { .. } | Item::Feed(_) => {
                let path = self.path;
                let stretch =
                    self.stretch.get_or_insert(Stretch { first: number, path_before: path, last: None });
                if let Some((_, start)) = piece(item) {
                    stretch.last = Some((number, start, path));
                    self.path += 1;
                }
            }
            Item::EndOfStretch(end) => {
                (self.here, self.rest, self.stretch) = (end, number + 1, None);
                self.path += 1;
            }
            Item::Dwell(_) if waits => self.wait = Some(*item),
            Item::Dwell(_) => {}
            Item::Stop => self.stops += 1,
            Item::Switch(to) => {
                let spindle = |outputs: &OutputState| (outputs.spindle, outputs.speed_rpm);
                // For the coolant alone nothing is waited for.
                if spindle(&to) != spindle(&self.outputs) {
                    (self.wait, self.is_spindle_switched) = (None, true);
                }
                self.outputs = to;
            }
        }
    }

    /// Switches spindle and coolant to what they are, and waits for the spindle.
    fn lead(&self) -> Vec<Item<M>> {
        if self.outputs == OutputState::OFF {
            return Vec::new();
        }
        let wait = self.wait.filter(|_| self.outputs.spindle_turns());
        std::iter::once(Item::Switch(self.outputs)).chain(wait).collect()
    }
}

/// The program line of a piece of path, and where it starts; none of another item.
pub(super) fn piece<const M: usize>(item: &Item<M>) -> Option<(u32, [Position; M])> {
    match item {
        Item::Line { line, start, .. } | Item::Septic { line, start, .. } => Some((*line, *start)),
        _ => None,
    }
}

fn is_end<const M: usize>(item: &Item<M>) -> bool {
    matches!(item, Item::EndOfStretch(_))
}

/// The checksum at the end of a compiled program.
pub(super) fn checksum(program: &[u8]) -> u32 {
    program.last_chunk().map_or(0, |sum| u32::from_le_bytes(*sum))
}

/// A machine's parameters for a board of `M` axes: a compiled program without items.
#[must_use]
pub fn parameters<const N: usize, const M: usize>(machine: &Machine<N>) -> Vec<u8> {
    bytes_of::<N, M>(machine, [])
}
