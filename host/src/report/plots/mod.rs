//! Shared by all plots: the layout they are drawn on, the panel with its axes, and the wrapping for the page.
//!
//! Every plot is drawn twice, for a wide and for a narrow page, because a picture scaled down to a phone
//! takes its letters along. The style layout shows one of the two. The drawing library places things on whole
//! units only, so a layout has [`UNITS_PER_PX`] of them to a pixel, and a smooth curve stays smooth.

pub(super) mod graph;
pub(super) mod polar;

use std::io;

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::format::{escape, scale_mark};
use super::palette::{self, Ink};
use super::summary::Span;

/// Drawing units to a pixel of the page.
pub(super) const UNITS_PER_PX: u32 = 4;

/// A part of the picture.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A pair of axes in it.
pub(super) type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// Drawing into memory fails only if the drawing library rejects something.
pub(super) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<io::Error>>;

/// Paper of one width. All lengths in drawing units.
#[derive(Debug)]
pub(super) struct Layout {
    /// Class of the drawing in the style layout.
    pub(super) class: &'static str,
    /// Width.
    pub(super) width: u32,
    /// Height of the letters as the drawing library counts it, 1.24 times the font size.
    pub(super) text: u32,
    /// Room left of the axes for the numbers.
    pub(super) left: u32,
    /// Room right of the axes.
    pub(super) right: u32,
    /// Columns a curve is reduced to.
    pub(super) columns: usize,
    /// About how many marks the axes get, along and upwards.
    pub(super) marks: (usize, usize),
    /// Height of one panel in a stack, without the axis below it.
    pub(super) panel_height: u32,
    /// Line width of curves.
    pub(super) stroke: u32,
}

/// The layout for a screen or a printed page.
const WIDE: Layout = Layout {
    class: "wide",
    width: 960 * UNITS_PER_PX,
    text: 62,
    left: 70 * UNITS_PER_PX,
    right: 24 * UNITS_PER_PX,
    columns: 900,
    marks: (12, 5),
    panel_height: 150 * UNITS_PER_PX,
    stroke: 7,
};

/// The layout for a phone.
const NARROW: Layout = Layout {
    class: "narrow",
    width: 358 * UNITS_PER_PX,
    text: 58,
    left: 66 * UNITS_PER_PX,
    right: 16 * UNITS_PER_PX,
    columns: 300,
    marks: (5, 5),
    panel_height: 120 * UNITS_PER_PX,
    stroke: 7,
};

impl Layout {
    /// Letters in `ink`, held at `anchor`.
    pub(super) fn letters(&self, ink: Ink, h: HPos, v: VPos) -> TextStyle<'static> {
        let mut style = TextStyle::from(("sans-serif", self.text).into_font()).pos(Pos::new(h, v));
        style.color = ink.rgb().to_backend_color();
        style
    }

    /// Room a title takes above its panel.
    pub(super) fn title_height(&self) -> u32 {
        self.text * 3 / 2
    }

    /// Room the marks and the name of the axis take below a panel.
    pub(super) fn axis_height(&self) -> u32 {
        self.text * 5 / 2
    }
}

/// The title and the description of a drawing, for those who cannot see it.
pub(super) struct Caption<'a> {
    /// Unique on the page.
    pub(super) id: &'a str,
    /// Short name.
    pub(super) title: &'a str,
    /// One or two sentences with the figures a reader would take from the picture.
    pub(super) description: &'a str,
}

/// Draws for both widths; `height` may depend on the layout.
pub(super) fn on_both_layouts(
    caption: &Caption<'_>,
    height: impl Fn(&Layout) -> u32,
    draw: impl Fn(&Area<'_>, &Layout) -> Drawn,
) -> io::Result<String> {
    let mut page = String::new();
    for layout in [&WIDE, &NARROW] {
        let size = (layout.width, height(layout));
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            draw(&area, layout).and_then(|()| area.present()).map_err(io::Error::other)?;
        }
        // The library's own opening tag fixes the size in pixels and names nothing.
        let drawing = svg.split_once('>').map_or("", |(_, rest)| rest);
        let (id, class) = (caption.id, layout.class);
        page.push_str(&format!(
            "<svg class=\"{class}\" viewBox=\"0 0 {} {}\" role=\"img\" aria-labelledby=\"{id}-{class}-t {id}-{class}-d\" \
             xmlns=\"http://www.w3.org/2000/svg\"><title id=\"{id}-{class}-t\">{}</title>\
             <desc id=\"{id}-{class}-d\">{}</desc>{drawing}",
            size.0,
            size.1,
            escape(caption.title),
            escape(caption.description),
        ));
    }
    Ok(page)
}

/// The wide one of two `drawings` as a picture of its own, on white paper, with its legend under it.
pub(super) fn picture(drawings: &str, legend: &[(Ink, String)]) -> String {
    let wide = drawings.split_once("</svg>").map_or("", |(wide, _)| wide);
    let (tag, body) = wide.split_once('>').unwrap_or_default();
    let height = tag.split('"').nth(3).and_then(|view| view.rsplit(' ').next()?.parse().ok()).unwrap_or(0);
    let (width, row) = (WIDE.width, WIDE.text * 8 / 5);
    let all = height + row * (legend.len() as u32 + 1);
    let id = tag.split('"').find(|part| part.ends_with("-wide-t")).unwrap_or("");
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {all}\" role=\"img\" aria-labelledby=\"{}\" \
         xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">\n<style>\n\
         svg polyline{{stroke-linejoin:round}}\n{}</style>\n<rect width=\"{width}\" height=\"{all}\" \
         fill=\"#FFFFFF\"/>{body}",
        id,
        palette::picture_style_sheet(),
    );
    let (left, line) = (WIDE.left, 60 * UNITS_PER_PX);
    for ((ink, words), index) in legend.iter().zip(1..) {
        let y = height + row * index;
        svg.push_str(&format!(
            "<path d=\"M{left} {y}h{line}\" fill=\"none\" stroke-width=\"12\" stroke=\"{}\"/>\
             <text x=\"{}\" y=\"{y}\" dy=\"0.35em\" font-size=\"{}\" fill=\"{}\">{}</text>\n",
            ink.hex(),
            left + line + WIDE.text / 2,
            WIDE.text * 25 / 31,
            palette::TEXT.hex(),
            escape(words),
        ));
    }
    svg.push_str("</svg>\n");
    svg
}

/// A pair of axes to be drawn.
pub(super) struct Panel<'a> {
    /// Quantity and unit, above the axes.
    pub(super) title: &'a str,
    /// Ends of the horizontal axis.
    pub(super) x: (f64, f64),
    /// Ends of the vertical axis.
    pub(super) y: (f64, f64),
    /// Name and unit of the horizontal axis; without one it has neither marks nor name.
    pub(super) x_name: Option<&'a str>,
    /// The horizontal axis holds decimal logarithms, and is marked with what they are of.
    pub(super) is_logarithmic: bool,
}

impl Panel<'_> {
    /// Draws title, grid and axes. A panel without a horizontal axis leaves a gap below, so that the lowest
    /// number keeps clear of the next title.
    pub(super) fn draw<'a>(&self, area: &Area<'a>, layout: &Layout) -> Drawn<Chart<'a>> {
        let title = layout.letters(palette::TEXT, HPos::Left, VPos::Top);
        area.draw(&Text::new(self.title.to_string(), (layout.left as i32, 4), title))?;
        let mut chart = ChartBuilder::on(area)
            .margin_top(layout.title_height())
            .margin_right(layout.right)
            .margin_bottom(if self.x_name.is_some() { 0 } else { layout.text / 2 })
            .y_label_area_size(layout.left)
            .x_label_area_size(if self.x_name.is_some() { layout.axis_height() } else { 0 })
            .build_cartesian_2d(self.x.0..self.x.1, self.y.0..self.y.1)?;
        let (x_span, y_span) = (self.x.1 - self.x.0, self.y.1 - self.y.0);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(palette::GRID.rgb().stroke_width(4))
            .axis_style(palette::AXIS.rgb().stroke_width(4))
            .set_all_tick_mark_size(16)
            .x_labels(if self.is_logarithmic { 0 } else { layout.marks.0 })
            .y_labels(layout.marks.1)
            .x_label_formatter(&|x| scale_mark(*x, x_span))
            .y_label_formatter(&|y| scale_mark(*y, y_span))
            .x_desc(self.x_name.unwrap_or(""))
            .label_style(layout.letters(palette::TEXT, HPos::Center, VPos::Center))
            .axis_desc_style(layout.letters(palette::TEXT, HPos::Center, VPos::Center))
            .draw()?;
        if self.is_logarithmic {
            self.decades(&mut chart, area, layout)?;
        }
        if self.y.0 < 0.0 && self.y.1 > 0.0 {
            chart.draw_series([PathElement::new(
                [(self.x.0, 0.0), (self.x.1, 0.0)],
                palette::RULE.rgb().stroke_width(4),
            )])?;
        }
        Ok(chart)
    }

    /// Grid lines and marks at 1, 2, 5, 10, …
    fn decades(&self, chart: &mut Chart<'_>, area: &Area<'_>, layout: &Layout) -> Drawn {
        let (low, high) = (self.x.0.floor() as i32, self.x.1.ceil() as i32);
        let all = (low..=high).flat_map(|decade| [1.0, 2.0, 5.0].map(|part| part * 10f64.powi(decade)));
        let rounding = 1e-9;
        let marks: Vec<f64> =
            all.filter(|mark| (self.x.0 - rounding..=self.x.1 + rounding).contains(&mark.log10())).collect();
        let grid = palette::GRID.rgb().stroke_width(4);
        chart.draw_series(
            marks
                .iter()
                .map(|mark| PathElement::new([(mark.log10(), self.y.0), (mark.log10(), self.y.1)], grid)),
        )?;
        if self.x_name.is_some() {
            let (left, top) = area.get_base_pixel();
            for mark in marks {
                let (x, y) = chart.backend_coord(&(mark.log10(), self.y.0));
                let style = layout.letters(palette::TEXT, HPos::Center, VPos::Top);
                let at = (x - left, y - top + layout.text as i32 / 3);
                area.draw(&Text::new(scale_mark(mark, mark), at, style))?;
            }
        }
        Ok(())
    }
}

/// A curve through `points`, or a dot if there is only one.
pub(super) fn curve(chart: &mut Chart<'_>, points: Vec<(f64, f64)>, ink: Ink, stroke: u32) -> Drawn {
    if let [only] = points[..] {
        chart.draw_series([Circle::new(only, 8, ink.rgb().filled())])?;
    } else if !points.is_empty() {
        chart.draw_series([PathElement::new(points, ink.rgb().stroke_width(stroke))])?;
    }
    Ok(())
}

/// Ends of an axis that shows all of `span`, and zero, with a little air. Never empty.
pub(super) fn ends_with_zero(span: Span) -> (f64, f64) {
    if span.magnitude() < f64::MIN_POSITIVE {
        return (-1.0, 1.0);
    }
    let (low, high) = (span.low.min(0.0), span.high.max(0.0));
    let air = 0.06 * (high - low);
    (if low < 0.0 { low - air } else { 0.0 }, if high > 0.0 { high + air } else { 0.0 })
}
