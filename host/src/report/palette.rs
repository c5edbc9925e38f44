//! One colour per idea, on light and on dark paper.
//!
//! Pages have the inks as variables of their style sheet, by name; pictures of documents have the light colours. A colour
//! stands for one ink and must be unique. Lines keep a contrast of at least 3:1 to the paper, text of at least 4.5:1, and
//! where several lines share a plot they also differ in their dashes.

/// A colour on light and on dark paper, and the dashes of a line drawn in it (empty: solid).
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    light: u32,
    dark: u32,
    dash: &'static str,
}

const fn solid(light: u32, dark: u32) -> Ink {
    Ink { light, dark, dash: "" }
}

const fn dashed(light: u32, dark: u32, dash: &'static str) -> Ink {
    Ink { light, dark, dash }
}

impl Ink {
    /// What a page calls it.
    pub(super) fn name(self) -> String {
        let name = named().find(|(_, ink)| ink.light == self.light).map(|(name, _)| name);
        name.unwrap_or_default()
    }

    /// The colour on light paper, as pictures and style sheets write it.
    #[cfg(any(test, feature = "terminal"))]
    pub(super) fn hex(self) -> String {
        format!("#{:06x}", self.light)
    }

    /// The dashes and gaps of its lines; empty for a solid one.
    #[cfg(feature = "terminal")]
    pub(super) fn dash(self) -> &'static str {
        self.dash
    }
}

/// Numbers and words in a plot.
pub(super) const TEXT: Ink = solid(0x1C2530, 0xE4E9EF);
/// Axes and tick marks.
pub(super) const AXIS: Ink = solid(0x6B7684, 0x8C98A6);
/// Grid.
pub(super) const GRID: Ink = solid(0xE1E5EA, 0x2C343E);
/// Junctions of blocks, and zero.
pub(super) const RULE: Ink = solid(0xBCC4CD, 0x47525F);
/// Times at which the program lets the machine stand.
pub(super) const REST: Ink = solid(0xF7EBCB, 0x38301C);
/// Limits of the machine.
pub(super) const LIMIT: Ink = dashed(0x59636F, 0x9AA6B3, "16 12");
/// Faults.
pub(super) const FAULT: Ink = dashed(0xC4162A, 0xFF6B6B, "20 12");
/// Commands of live control.
pub(super) const COMMAND: Ink = dashed(0x2F4A6B, 0xA9C3E6, "8 8");
/// The feed override.
pub(super) const OVERRIDE: Ink = solid(0x6B4E00, 0xDDBB55);
/// Feed.
pub(super) const FEED: Ink = solid(0x1F66B0, 0x6BB1F5);
/// Acceleration, and ceilings set by it.
pub(super) const ACCELERATION: Ink = solid(0x0B7A5F, 0x3CCBA4);
/// Jerk, and ceilings set by it.
pub(super) const JERK: Ink = solid(0x8740B5, 0xC596EE);
/// Snap, and ceilings set by it.
pub(super) const SNAP: Ink = solid(0xB05200, 0xF2A154);
/// Following error.
pub(super) const ERROR: Ink = solid(0xA8235E, 0xF588B4);
/// Contour error.
pub(super) const CONTOUR: Ink = solid(0x0F6E78, 0x4FC3CF);
/// Output voltage.
pub(super) const VOLTS: Ink = solid(0x4E6A00, 0xB2CE4B);

/// Ceilings: programmed, acceleration, jerk, snap, then others in the order in which they appear.
const CEILINGS: [Ink; 8] = [
    dashed(0x4A5563, 0xB4BECA, ""),
    dashed(0x0C7B60, 0x3DCCA5, "32 12"),
    dashed(0x8841B6, 0xC697EF, "14 10"),
    dashed(0xB15301, 0xF3A255, "32 10 8 10"),
    dashed(0xA9245F, 0xF689B5, "16 8"),
    dashed(0x7A5C00, 0xD9B84A, "48 12"),
    dashed(0x0A7285, 0x4CC4DA, "20 8 8 8 8 8"),
    dashed(0x39509E, 0x9DB1F7, "12 20"),
];

/// The name of a ceiling that the feed does not reach.
pub(super) const NOT_REACHED: &str = "not reached";

/// Its ink. It limits nothing, so it is paler than the others.
const UNREACHED: Ink = dashed(0x6F7A88, 0x8F9BA9, "6 14");

/// Ink of a ceiling. `known` are the reasons of this run in the order of their appearance; from the ninth on
/// they share the last ink.
pub(super) fn ceiling(reason: &str, known: &[&str]) -> Ink {
    if reason == NOT_REACHED {
        return UNREACHED;
    }
    const OWN: [&str; 4] = ["programmed", "acceleration", "jerk", "snap"];
    if let Some(index) = OWN.iter().position(|own| *own == reason) {
        return CEILINGS[index];
    }
    let others = known.iter().filter(|other| !OWN.contains(other) && **other != NOT_REACHED);
    let index = OWN.len() + others.take_while(|other| **other != reason).count();
    CEILINGS[index.min(CEILINGS.len() - 1)]
}

/// Classes of feed along the path, slow to fast: brightness rises with the feed, so that the order survives a
/// grey-scale printer.
pub(super) const CLASSES: [Ink; 6] = [
    solid(0x14086B, 0x8C5FE0),
    solid(0x5A0FA0, 0xC24BC4),
    solid(0x9A1D96, 0xE8628F),
    solid(0xC43F74, 0xF78F5E),
    solid(0xDA5A4C, 0xFBBD4A),
    solid(0xE07A1F, 0xF3F26E),
];

/// Curves of one plot that are of one kind: axes, methods, gains.
pub(super) const SERIES: [Ink; 7] = [
    solid(0x1E65AF, 0x6AB0F4),
    dashed(0xAF5100, 0xF1A053, "36 12"),
    dashed(0x0A795E, 0x3BCAA3, "12 10"),
    dashed(0x863FB4, 0xC495ED, "36 10 10 10"),
    dashed(0xA7225D, 0xF487B3, "60 14"),
    dashed(0x4D6900, 0xB1CD4A, "20 8 6 8"),
    dashed(0x705A46, 0xC9AF96, "6 10"),
];

/// Ink of a curve among others of its kind; from the eighth on they begin anew.
pub(super) fn series(index: usize) -> Ink {
    SERIES[index % SERIES.len()]
}

/// Inks that stand alone, by what a page calls them.
const SINGLE: [(&str, Ink); 17] = [
    ("text", TEXT),
    ("axis", AXIS),
    ("grid", GRID),
    ("rule", RULE),
    ("rest", REST),
    ("limit", LIMIT),
    ("fault", FAULT),
    ("command", COMMAND),
    ("override", OVERRIDE),
    ("feed", FEED),
    ("acceleration", ACCELERATION),
    ("jerk", JERK),
    ("snap", SNAP),
    ("error", ERROR),
    ("contour", CONTOUR),
    ("volts", VOLTS),
    ("unreached", UNREACHED),
];

/// Inks with their names.
fn named() -> impl Iterator<Item = (String, Ink)> {
    let numbered = |name: &'static str, inks: &'static [Ink]| {
        inks.iter().enumerate().map(move |(index, &ink)| (format!("{name}-{index}"), ink))
    };
    let single = SINGLE.iter().map(|&(name, ink)| (name.to_owned(), ink));
    let numbered = [("ceiling", &CEILINGS[..]), ("class", &CLASSES), ("series", &SERIES)]
        .map(|(name, inks)| numbered(name, inks));
    single.chain(numbered.into_iter().flatten())
}

/// The inks as variables of a style sheet, which scripts and rules read.
pub(super) fn variables() -> String {
    let list = |colour: fn(&Ink) -> u32| -> String {
        named().map(|(name, ink)| format!("--{name}:#{:06x};", colour(&ink))).collect()
    };
    let dashes: String = named().map(|(name, ink)| format!("--dash-{name}:{};", ink.dash)).collect();
    let (light, dark) = (list(|ink| ink.light), list(|ink| ink.dark));
    format!(
        ":root{{{light}{dashes}}}\n@media screen and (prefers-color-scheme:dark){{:root:not([data-theme=light]){{{dark}}}}}\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inks() -> impl Iterator<Item = Ink> {
        named().map(|(_, ink)| ink)
    }

    fn luminance(colour: u32) -> f64 {
        let [_, r, g, b] = colour.to_be_bytes();
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
    }

    fn contrast(a: u32, b: u32) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    const LIGHT_PAPER: u32 = 0xFFFFFF;
    const DARK_PAPER: u32 = 0x151A20;

    #[test]
    fn every_line_stands_out_from_its_paper() {
        let no_lines = [TEXT, GRID, RULE, REST].map(|ink| ink.light);
        for ink in inks().filter(|ink| !no_lines.contains(&ink.light)) {
            let hex = ink.hex();
            assert!(contrast(ink.light, LIGHT_PAPER) >= 3.0, "{hex} {}", contrast(ink.light, LIGHT_PAPER));
            assert!(contrast(ink.dark, DARK_PAPER) >= 3.0, "{hex} {}", contrast(ink.dark, DARK_PAPER));
        }
        assert!(contrast(TEXT.light, LIGHT_PAPER) >= 7.0 && contrast(TEXT.dark, DARK_PAPER) >= 7.0);
    }

    #[test]
    fn feed_classes_grow_brighter() {
        for pair in CLASSES.windows(2) {
            assert!(luminance(pair[0].light) < luminance(pair[1].light));
            assert!(luminance(pair[0].dark) < luminance(pair[1].dark));
        }
    }

    #[test]
    fn a_colour_names_one_ink() {
        let mut seen: Vec<u32> = inks().map(|ink| ink.light).collect();
        let number = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), number);
    }

    #[test]
    fn unknown_reasons_get_inks_of_their_own() {
        let known = ["programmed", "axis velocity", "corner"];
        let inks = known.map(|reason| ceiling(reason, &known).light);
        assert_eq!(inks, [CEILINGS[0].light, CEILINGS[4].light, CEILINGS[5].light]);
        let names = ["snap", "corner", NOT_REACHED].map(|reason| ceiling(reason, &known).name());
        assert_eq!(names, ["ceiling-3", "ceiling-5", "unreached"]);
        assert!(variables().contains("--ceiling-5:#7a5c00;") && variables().contains("--dash-fault:20 12;"));
    }
}
