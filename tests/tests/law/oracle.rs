//! The law from its definition, in thirty digits: (22), (23), (13) and what they become with a plateau choose
//! the ramp, and the jerk J(t) = ±Jp·sin²(πt/2e) in edges, ±Jp between them, is integrated numerically. None
//! of the closed forms (3)–(5) is used.
//!
//! One step of the three cumulative integrals over \[a, b\], h = b − a, is Taylor's formula with its
//! remainder as an integral of the jerk,
//!
//! ```text
//! A(b) = A(a) + ∫ J(s) ds
//! V(b) = V(a) + A(a)·h + ∫ (b − s)·J(s) ds
//! S(b) = S(a) + V(a)·h + A(a)·h²/2 + ∫ (b − s)²/2·J(s) ds
//! ```
//!
//! by six-point Gauss–Legendre on panels of at most 1/64 of an arch: its error is below 10⁻²⁹.

use motion_kernel::law::{Limits, Pulse};
use motion_tests::dd::{Dd, dd};

const NODES: usize = 6;
/// Panels in an edge are at most this part of an arch.
const PANEL: f64 = 1.0 / 64.0;

/// What the integration needs and no ramp changes.
pub(crate) struct Quadrature {
    /// Nodes on \[0, 1\] and weights.
    nodes: [(Dd, Dd); NODES],
    /// (−1)^k π^(2k+1)/(2k+1)! and (−1)^k π^(2k)/(2k)!.
    sine: [Dd; 14],
    cosine: [Dd; 14],
}

impl Quadrature {
    pub(crate) fn new() -> Self {
        let nodes = std::array::from_fn(|i| {
            let guess = (std::f64::consts::PI * (i as f64 + 0.75) / (NODES as f64 + 0.5)).cos();
            let mut x = dd(guess);
            let mut slope = dd(1.0);
            for _ in 0..6 {
                let (mut before, mut p) = (dd(1.0), x);
                for k in 2..=NODES {
                    let k = k as f64;
                    (before, p) = (p, (dd(2.0 * k - 1.0) * x * p - dd(k - 1.0) * before) / dd(k));
                }
                slope = dd(NODES as f64) * (x * p - before) / (x * x - dd(1.0));
                x = x - p / slope;
            }
            let weight = dd(1.0) / ((dd(1.0) - x * x) * slope * slope);
            ((x + dd(1.0)) * dd(0.5), weight)
        });
        let series = |mut term: Dd, first: f64| {
            let mut n = first;
            std::array::from_fn(|_| {
                let here = term;
                term = -(term * Dd::PI * Dd::PI / dd((n + 1.0) * (n + 2.0)));
                n += 2.0;
                here
            })
        };
        Self { nodes, sine: series(Dd::PI, 1.0), cosine: series(dd(1.0), 0.0) }
    }

    /// (sin πx, cos πx) for x in \[0, 1\].
    fn sin_cos(&self, x: Dd) -> (Dd, Dd) {
        if x.hi > 0.5 {
            let (sine, cosine) = self.sin_cos(dd(1.0) - x);
            return (sine, -cosine);
        }
        if x.hi > 0.25 {
            let (sine, cosine) = self.sin_cos(dd(0.5) - x);
            return (cosine, sine);
        }
        let square = x * x;
        let sum = |terms: &[Dd; 14]| terms.iter().rev().fold(Dd::ZERO, |sum, &term| sum * square + term);
        (sum(&self.sine) * x, sum(&self.cosine))
    }

    /// sin²πx.
    fn pulse(&self, x: Dd) -> Dd {
        let x = if x.hi > 0.5 { dd(1.0) - x } else { x };
        let square = x * x;
        let root = if x.hi > 0.25 {
            let y = dd(0.5) - x;
            let square = y * y;
            self.cosine.iter().rev().fold(Dd::ZERO, |sum, &term| sum * square + term)
        } else {
            self.sine.iter().rev().fold(Dd::ZERO, |sum, &term| sum * square + term) * x
        };
        root * root
    }
}

/// The motion at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    pub(crate) s: Dd,
    pub(crate) v: Dd,
    pub(crate) a: Dd,
    pub(crate) j: Dd,
    pub(crate) snap: Dd,
}

/// A ramp as S1 defines it; `jerk` carries the sign of the change of feed.
pub(crate) struct Exact<'a> {
    quadrature: &'a Quadrature,
    from: Dd,
    to: Dd,
    pub(crate) jerk: Dd,
    pub(crate) edge: Dd,
    pub(crate) t1: Dd,
    pub(crate) t2: Dd,
    pub(crate) end: Dd,
    /// S(t_p) by integration.
    pub(crate) length: Dd,
}

/// Jp, e, t₁, t₂.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    pub(crate) jerk: Dd,
    pub(crate) edge: Dd,
    pub(crate) t1: Dd,
    pub(crate) t2: Dd,
}

/// The ramp by (22), (23), (13); with a plateau, by what its edges, its jerk and its acceleration may be at
/// most. Zero for no change.
pub(crate) fn choose(pulse: Pulse, limits: &Limits<f64>, change: Dd) -> Choice {
    let (accel, jerk, snap) = (dd(limits.accel_mm_s2), dd(limits.jerk_mm_s3), dd(limits.snap_mm_s4));
    if change.hi <= 0.0 {
        return Choice { jerk: Dd::ZERO, edge: Dd::ZERO, t1: Dd::ZERO, t2: Dd::ZERO };
    }
    let (half, two) = (dd(0.5), dd(2.0));
    if pulse == Pulse::Plateau {
        let by_snap = Dd::PI / (two * snap);
        let edge = (by_snap * jerk).min((by_snap * accel).sqrt()).min((by_snap * change * half).cbrt());
        let peak = edge / by_snap;
        let by_jerk = half * edge + (half * half * edge * edge + change / peak).sqrt();
        let t1 = (accel / peak + edge).min(by_jerk);
        return Choice { jerk: peak, edge, t1, t2: change / (peak * (t1 - edge)) };
    }
    let peak = jerk
        .min((two * accel * snap / Dd::PI).sqrt())
        .min((two * change * snap * snap / (Dd::PI * Dd::PI)).cbrt());
    let t1 = (two * accel / peak).min((two * change / peak).sqrt());
    Choice { jerk: peak, edge: half * t1, t1, t2: two * change / (peak * t1) }
}

/// Λ, the length of the ramp between two feeds: (12).
pub(crate) fn length(pulse: Pulse, limits: &Limits<f64>, from: Dd, to: Dd) -> Dd {
    let Choice { t1, t2, .. } = choose(pulse, limits, (to - from).abs());
    (from + to) * dd(0.5) * (t1 + t2)
}

impl<'a> Exact<'a> {
    pub(crate) fn new(
        quadrature: &'a Quadrature,
        (pulse, limits): (Pulse, &Limits<f64>),
        from: f64,
        to: f64,
    ) -> Self {
        let (from, to) = (dd(from), dd(to));
        let Choice { jerk: peak, edge, t1, t2 } = choose(pulse, limits, (to - from).abs());
        let jerk = if to < from { -peak } else { peak };
        let mut exact = Self { quadrature, from, to, jerk, edge, t1, t2, end: t1 + t2, length: Dd::ZERO };
        let top = exact.hold(&exact.pulse(&exact.start(), t1, jerk), t2 - t1);
        let last = exact.pulse(&top, t1, -jerk);
        exact.length = last.s;
        let scale = from + to;
        assert!((last.v - to).abs().hi <= 1e-28 * scale.hi, "the oracle's own feed: {last:?}");
        assert!(last.a.abs().hi <= 1e-28 * (jerk * t1).abs().hi, "the oracle's own end: {last:?}");
        exact
    }

    fn start(&self) -> Motion {
        Motion { v: self.from, ..Motion::default() }
    }

    /// A whole pulse of jerk from its start.
    fn pulse(&self, from: &Motion, to: Dd, jerk: Dd) -> Motion {
        let mut motion = *from;
        self.advance(&mut motion, Dd::ZERO, to, jerk);
        motion
    }

    /// From `a` to `b` after a pulse's start.
    fn advance(&self, motion: &mut Motion, a: Dd, b: Dd, jerk: Dd) {
        // Panels end where the edges do.
        for knot in [self.edge, self.t1 - self.edge] {
            if a < knot && knot < b {
                self.advance(motion, a, knot, jerk);
                return self.advance(motion, knot, b, jerk);
            }
        }
        let half = dd(0.5);
        let is_plateau = a >= self.edge && b <= self.t1 - self.edge;
        let arch = dd(2.0) * self.edge;
        let panels = if is_plateau { 1.0 } else { ((b - a).hi / (arch.hi * PANEL)).ceil().max(1.0) };
        let h = (b - a) / dd(panels);
        for panel in 0..panels as u32 {
            let start = a + h * dd(f64::from(panel));
            let (mut zeroth, mut first, mut second) = (Dd::ZERO, Dd::ZERO, Dd::ZERO);
            for &(node, weight) in &self.quadrature.nodes {
                let left = (dd(1.0) - node) * h;
                let at = start + node * h;
                let near = at.min(self.t1 - at);
                let value = if is_plateau { weight } else { weight * self.quadrature.pulse(near / arch) };
                zeroth = zeroth + value;
                first = first + value * left;
                second = second + value * left * left;
            }
            let scale = jerk * h;
            motion.s = motion.s + motion.v * h + motion.a * h * h * half + second * scale * half;
            motion.v = motion.v + motion.a * h + first * scale;
            motion.a = motion.a + zeroth * scale;
        }
    }

    fn hold(&self, from: &Motion, time: Dd) -> Motion {
        Motion {
            s: from.s + from.v * time + from.a * time * time * dd(0.5),
            v: from.v + from.a * time,
            a: from.a,
            ..Motion::default()
        }
    }

    /// With jerk and snap by definition, `t` after the start of a pulse of `jerk`.
    fn with_jerk(&self, motion: &Motion, t: Dd, jerk: Dd) -> Motion {
        let left = self.t1 - t;
        if t >= self.edge && left >= self.edge {
            return Motion { j: jerk, snap: Dd::ZERO, ..*motion };
        }
        let arch = dd(2.0) * self.edge;
        let (sine, cosine) = self.quadrature.sin_cos(t.min(left) / arch);
        let snap = jerk * Dd::PI / arch * dd(2.0) * sine * cosine;
        Motion { j: jerk * sine * sine, snap: if t < left { snap } else { -snap }, ..*motion }
    }

    /// The motion at each of `times_s`, which ascend. The falling phase is integrated backwards from
    /// the end, where the acceleration is 0 and the feed is the ramp's: near the end the small values
    /// keep their digits that way.
    pub(crate) fn at_each(&self, times_s: &[f64]) -> Vec<Motion> {
        let mut motions = vec![Motion::default(); times_s.len()];
        let (mut motion, mut reached) = (self.start(), Dd::ZERO);
        let held = self.pulse(&self.start(), self.t1, self.jerk);
        for (&t, out) in times_s.iter().zip(&mut motions) {
            let t = dd(t);
            if t <= self.t1 {
                self.advance(&mut motion, reached, t, self.jerk);
                reached = t;
                *out = self.with_jerk(&motion, t, self.jerk);
            } else if t <= self.t2 {
                *out = self.hold(&held, t - self.t1);
            }
        }
        // Backwards in time the feed is that of a ramp with the jerk's sign reversed.
        let (mut motion, mut reached) = (Motion { v: self.to, ..Motion::default() }, Dd::ZERO);
        for (&t, out) in times_s.iter().zip(&mut motions).rev() {
            let left = self.end - dd(t);
            if left <= Dd::ZERO {
                *out = Motion { s: self.length - self.to * left, v: self.to, ..Motion::default() };
            } else if dd(t) > self.t2 {
                self.advance(&mut motion, reached, left, -self.jerk);
                reached = left;
                let here = self.with_jerk(&motion, left, self.jerk);
                *out = Motion { s: self.length - here.s, a: -here.a, j: -here.j, ..here };
            }
        }
        motions
    }
}
