//! Trace of one firing: amplified signal as on an oscilloscope, envelope against threshold, and the
//! ECHO output.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    caption,
    labels::Labels,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    theme, ticks,
};
use sonard_model::acoustics::EchoTrace;

/// Minimum level shown, dB re head-on wall.
const FLOOR_DB: f64 = -60.0;
const TOP_DB: f64 = 10.0;

/// Maximum number of numbered peaks.
const MAX_NUMBERED: usize = 12;

/// Peaks farther below the threshold are numbered only if they are prominent, decibels.
const NUMBERED_BELOW_DB: f64 = 12.0;

/// Maximum ratio of the envelope to a prominent peak at its time.
const PROMINENT: f64 = 1.5;

/// Firing with its caption and the names of its peaks.
#[derive(Debug, Clone)]
pub struct TraceView<'a> {
    /// Title above the picture.
    pub title: String,
    /// Lines below the title.
    pub lines: Vec<String>,
    /// Simulated trace.
    pub trace: &'a EchoTrace,
    /// Names of the peaks, in their order.
    pub names: Vec<String>,
    /// Time from firing to the end of blanking, microseconds.
    pub blanking_us: f64,
    /// Duration of the BLNK pulse after an echo, microseconds.
    pub rearm_us: f64,
    /// Speed of sound, metres per second.
    pub sound_speed_m_s: f64,
}

/// Draws the trace of a firing. The first panel is the signal as on an oscilloscope (envelope on
/// both sides of zero). The second has its level with the detection threshold, the blanking and the
/// rising edges of ECHO. Gain and ECHO follow. Numbers on the peaks refer to the paths listed
/// below.
#[must_use]
pub fn draw_trace(view: &TraceView) -> Picture {
    let (heading, top) =
        caption::draw(&view.title, Some("SIMULATED, nothing measured"), &view.lines);
    let panels = TracePanels::new(view, top + 26.0);
    let numbered = numbered(view);
    let mut page = Layer::new("trace");
    page.add(heading);
    for layer in
        [panels.signal(view), panels.levels(view, &numbered), panels.gain(view), panels.echo(view)]
    {
        page.add(layer);
    }
    let below = Px::new(theme::MARGIN_PX, panels.echo.bottom + 52.0);
    let width = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let (key, height) = legend::draw(&legend_entries(view, panels.until_us), below, width);
    page.add(key);
    let (list, bottom) = list(view, &numbered, below.y + height + 12.0);
    page.add(list);
    Picture::new(theme::PAGE_PX, bottom + theme::MARGIN_PX / 2.0, page)
}

/// Numbered peak; simultaneous arrivals of the same name are combined.
struct NumberedPeak {
    peak: f64,
    peak_us: f64,
    tof_us: f64,
    name: String,
    count: usize,
}

/// Strongest peaks, in order of time.
fn numbered(view: &TraceView) -> Vec<NumberedPeak> {
    let floor = 10f64.powf(FLOOR_DB / 20.0);
    let is_visible = |peak: f64, peak_us: f64| {
        let points = &view.trace.points;
        let point = points.iter().find(|point| point.t_us >= peak_us).or(points.last());
        point.is_some_and(|point| {
            peak >= point.threshold * 10f64.powf(-NUMBERED_BELOW_DB / 20.0)
                || (peak > floor && point.envelope <= PROMINENT * peak)
        })
    };
    let mut peaks: Vec<NumberedPeak> = Vec::new();
    for (found, name) in view.trace.peaks.iter().zip(&view.names) {
        let (peak, peak_us) = found.peak;
        if !is_visible(peak, peak_us) {
            continue;
        }
        let same = |known: &&mut NumberedPeak| {
            known.name == *name && (known.tof_us - found.tof_us).abs() < 1.0
        };
        match peaks.iter_mut().find(same) {
            Some(known) => {
                known.peak = known.peak.max(peak);
                known.count += 1;
            }
            None => peaks.push(NumberedPeak {
                peak,
                peak_us,
                tof_us: found.tof_us,
                name: name.clone(),
                count: 1,
            }),
        }
    }
    peaks.sort_by(|a, b| b.peak.total_cmp(&a.peak));
    peaks.truncate(MAX_NUMBERED);
    peaks.sort_by(|a, b| a.tof_us.total_cmp(&b.tof_us));
    peaks
}

struct TracePanels {
    signal: Rect,
    levels: Rect,
    gain: Rect,
    echo: Rect,
    until_us: f64,
    sound_speed_m_s: f64,
}

impl TracePanels {
    fn new(view: &TraceView, top: f64) -> Self {
        let left = theme::MARGIN_PX + 46.0;
        let width = theme::PAGE_PX - theme::MARGIN_PX - left;
        let until_us = view.trace.points.last().map_or(1.0, |point| point.t_us).max(1.0);
        let signal = Rect::new(left, top, width, 150.0);
        let levels = Rect::new(left, signal.bottom + 34.0, width, 290.0);
        let gain = Rect::new(left, levels.bottom + 34.0, width, 60.0);
        let echo = Rect::new(left, gain.bottom + 34.0, width, 30.0);
        Self { signal, levels, gain, echo, until_us, sound_speed_m_s: view.sound_speed_m_s }
    }

    fn x(&self, t_us: f64) -> f64 {
        self.signal.left + (t_us / self.until_us).clamp(0.0, 1.0) * self.signal.width()
    }

    fn level_y(&self, amplitude: f64) -> f64 {
        let db = 20.0 * amplitude.max(1e-9).log10();
        let share = ((db - FLOOR_DB) / (TOP_DB - FLOOR_DB)).clamp(0.0, 1.0);
        self.levels.bottom - share * self.levels.height()
    }

    /// Draws border, title and vertical grid; times and ranges below on request.
    fn frame(&self, panel: Rect, title: &str, numbered: bool) -> Layer {
        let mut layer = Layer::new("frame");
        let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
        let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
        let until_ms = self.until_us / 1e3;
        let step = ticks::nice_step(until_ms, 12.0);
        for ms in ticks::multiples(0.0, until_ms, step) {
            let x = self.x(1e3 * ms);
            grid.line(Px::new(x, panel.top), Px::new(x, panel.bottom));
            if numbered {
                let range_m = self.sound_speed_m_s * ms * 1e-3 / 2.0;
                let at = |row: f64| Px::new(x, panel.bottom + row);
                numbers.text(at(15.0), Anchor::Middle, theme::SMALL_PX, &ticks::label(ms, step));
                let range = ticks::label(range_m, 0.01);
                numbers.text(at(30.0), Anchor::Middle, theme::SMALL_PX, &range);
            }
        }
        if numbered {
            let left = |row: f64| Px::new(panel.left - 22.0, panel.bottom + row);
            numbers.text(left(15.0), Anchor::End, theme::SMALL_PX, "ms");
            numbers.text(left(30.0), Anchor::End, theme::SMALL_PX, "m");
        }
        let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
        border.rect(panel, 0.0);
        layer.add(grid);
        layer.add(numbers);
        layer.add(border);
        let above = Px::new(panel.left, panel.top - 6.0);
        layer.text(above, Anchor::Start, theme::TEXT_PX, title);
        layer
    }

    fn blanking(&self, panel: Rect, blanking_us: f64) -> Layer {
        let mut layer = Layer::new("blanking").with("fill", theme::SKY).with("fill-opacity", 0.2);
        let width = self.x(blanking_us) - panel.left;
        layer.rect(Rect::new(panel.left, panel.top, width, panel.height()), 0.0);
        layer
    }

    /// Draws the envelope on both sides of zero, including the transmit pulse.
    fn signal(&self, view: &TraceView) -> Layer {
        let panel = self.signal;
        let highest = view.trace.points.iter().map(|point| point.envelope).fold(1.0, f64::max);
        let middle = panel.center().y;
        let y = |amplitude: f64| middle - 0.47 * panel.height() * amplitude / highest;
        let mut layer = Layer::new("signal");
        layer.add(self.blanking(panel, view.blanking_us));
        layer.add(self.frame(panel, "amplified signal (gain-compensated)", false));
        let both_sides = |points: &[(f64, f64)]| {
            let upper = points.iter().map(|&(t_us, size)| Px::new(self.x(t_us), y(size)));
            let lower = points.iter().rev().map(|&(t_us, size)| Px::new(self.x(t_us), y(-size)));
            upper.chain(lower).collect::<Vec<_>>()
        };
        let mut sent = Layer::new("transmission").with("fill", theme::ORANGE);
        sent.polygon(&both_sides(&view.trace.transmission));
        layer.add(sent);
        let points: Vec<_> = view.trace.points.iter().map(|p| (p.t_us, p.envelope)).collect();
        let mut received = Layer::new("envelope").with("fill", theme::BLUE);
        received.polygon(&both_sides(&points));
        layer.add(received);
        layer
    }

    fn levels(&self, view: &TraceView, numbered: &[NumberedPeak]) -> Layer {
        let panel = self.levels;
        let mut layer = Layer::new("levels");
        layer.add(self.blanking(panel, view.blanking_us));
        let title = "echo envelope and detection threshold, dB re head-on wall";
        layer.add(self.frame(panel, title, false));
        let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
        let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
        for db in ticks::multiples(FLOOR_DB, TOP_DB, 10.0) {
            let y = self.level_y(10f64.powf(db / 20.0));
            grid.line(Px::new(panel.left, y), Px::new(panel.right, y));
            let at = Px::new(panel.left - 5.0, y + 4.0);
            numbers.text(at, Anchor::End, theme::SMALL_PX, &ticks::label(db, 10.0));
        }
        layer.add(grid);
        layer.add(numbers);
        let run = |points: &mut dyn Iterator<Item = (f64, f64)>| -> Vec<Px> {
            points.map(|(t_us, size)| Px::new(self.x(t_us), self.level_y(size))).collect()
        };
        let points = &view.trace.points;
        let mut sent = Layer::new("transmission").stroked(theme::ORANGE, 1.6);
        sent.runs([run(&mut view.trace.transmission.iter().copied())]);
        let mut received = Layer::new("envelope").stroked(theme::BLUE, 1.4);
        received.runs([run(&mut points.iter().map(|p| (p.t_us, p.envelope)))]);
        let mut threshold = Layer::new("threshold").stroked(theme::VERMILLION, 1.2);
        let active = points.iter().filter(|p| p.t_us >= view.blanking_us);
        threshold.runs([run(&mut active.map(|p| (p.t_us, p.threshold)))]);
        layer.extend([sent, received, threshold]);
        layer.add(self.rises(view));
        layer.add(self.numbers(view, numbered));
        layer
    }

    /// Draws triangles at the rising edges of ECHO.
    fn rises(&self, view: &TraceView) -> Layer {
        let mut layer = Layer::new("rises").with("fill", theme::VERMILLION);
        for &echo_us in view.trace.detection.echoes_us.iter().filter(|us| **us <= self.until_us) {
            let point = view.trace.points.iter().find(|point| point.t_us >= echo_us);
            let y = self.level_y(point.map_or(1.0, |point| point.threshold));
            let range_m = self.sound_speed_m_s * echo_us * 1e-6 / 2.0;
            let hint = format!("ECHO rises at {echo_us:.1} us, {range_m:.4} m");
            layer.mark(MarkShape::Triangle, Px::new(self.x(echo_us), y + 7.0), 4.5, Some(&hint));
        }
        layer
    }

    fn numbers(&self, view: &TraceView, numbered: &[NumberedPeak]) -> Layer {
        let mut layer = Layer::new("numbers-of-peaks").haloed();
        let mut labels = Labels::new(self.levels);
        for point in &view.trace.points {
            labels.avoid_mark(Px::new(self.x(point.t_us), self.level_y(point.envelope)), 1.0);
        }
        for (number, peak) in (1..).zip(numbered) {
            let text = format!("{number}");
            let at = Px::new(self.x(peak.peak_us), self.level_y(peak.peak) - 5.0);
            // Next to each other, or stacked; off the line if possible.
            let shifts = (0..8)
                .flat_map(|row| [0.0, 12.0, -12.0].map(|x| Px::new(x, -14.0 * f64::from(row))));
            let places = shifts.map(|shift| (at + shift, Anchor::Middle));
            if let Some((at, anchor)) = labels.place_at_one(places, theme::SMALL_PX, &text) {
                layer.text(at, anchor, theme::SMALL_PX, &text);
            }
        }
        layer
    }

    fn gain(&self, view: &TraceView) -> Layer {
        let panel = self.gain;
        let mut layer = Layer::new("gain");
        layer.add(self.frame(panel, "gain, dB re 1 m", false));
        let (low, high) = (-15.0, 25.0);
        let y =
            |db: f64| panel.bottom - ((db - low) / (high - low)).clamp(0.0, 1.0) * panel.height();
        let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
        for db in [-10.0, 0.0, 10.0, 20.0] {
            let at = Px::new(panel.left - 5.0, y(db) + 4.0);
            numbers.text(at, Anchor::End, theme::SMALL_PX, &ticks::label(db, 10.0));
        }
        let mut line = Layer::new("line").stroked(theme::GREEN, 1.4);
        let points = view.trace.points.iter();
        line.runs([points.map(|p| Px::new(self.x(p.t_us), y(p.gain_db))).collect::<Vec<_>>()]);
        layer.add(numbers);
        layer.add(line);
        layer
    }

    fn echo(&self, view: &TraceView) -> Layer {
        let panel = self.echo;
        let mut layer = Layer::new("echo");
        layer.add(self.frame(panel, "ECHO output (re-armed by BLNK)", true));
        let (low, high) = (panel.bottom - 5.0, panel.top + 5.0);
        let mut run = vec![Px::new(panel.left, low)];
        for &echo_us in view.trace.detection.echoes_us.iter().filter(|us| **us <= self.until_us) {
            let (rise, fall) = (self.x(echo_us), self.x(echo_us + view.rearm_us));
            run.extend([(rise, low), (rise, high), (fall, high), (fall, low)].map(Px::from));
        }
        run.push(Px::new(panel.right, low));
        let mut line = Layer::new("line").stroked(theme::INK, 1.4);
        line.runs([run]);
        layer.add(line);
        layer
    }
}

/// Entries for what the panels show.
fn legend_entries(view: &TraceView, until_us: f64) -> Vec<LegendEntry> {
    let line = |colour| LegendSample::Line { colour, width_px: 2.0, dash: "none" };
    let rise = LegendSample::Mark { shape: MarkShape::Triangle, colour: theme::VERMILLION };
    let blanking = LegendSample::Line { colour: theme::SKY, width_px: 9.0, dash: "none" };
    let rises = view.trace.detection.echoes_us.iter().any(|echo_us| *echo_us <= until_us);
    [
        (!view.trace.transmission.is_empty())
            .then(|| LegendEntry::new(line(theme::ORANGE), "transmit pulse (clipped)")),
        Some(LegendEntry::new(line(theme::BLUE), "echo envelope")),
        (until_us > view.blanking_us)
            .then(|| LegendEntry::new(line(theme::VERMILLION), "detection threshold")),
        rises.then(|| LegendEntry::new(rise, "ECHO rises")),
        (view.blanking_us > 0.0).then(|| LegendEntry::new(blanking, "blanking")),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Draws the list of the numbered paths; returns the layer and its lower end.
fn list(view: &TraceView, numbered: &[NumberedPeak], top: f64) -> (Layer, f64) {
    let mut layer = Layer::new("paths");
    let mut y = top;
    for (number, peak) in (1..).zip(numbered) {
        y += theme::TEXT_PX + 4.0;
        let times = if peak.count > 1 { format!(" ({} paths)", peak.count) } else { String::new() };
        let range_m = view.sound_speed_m_s * peak.tof_us * 1e-6 / 2.0;
        let db = 20.0 * peak.peak.log10();
        let text = format!("{number}: {range_m:.3} m, {db:.1} dB via {}{times}", peak.name);
        layer.text(Px::new(theme::MARGIN_PX + 8.0, y), Anchor::Start, theme::TEXT_PX, &text);
    }
    if numbered.is_empty() {
        y += theme::TEXT_PX + 4.0;
        let text = "no arrival near the threshold";
        layer.text(Px::new(theme::MARGIN_PX + 8.0, y), Anchor::Start, theme::TEXT_PX, text);
    }
    (layer, y + 8.0)
}
