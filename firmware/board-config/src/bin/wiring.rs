//! Draws the wiring diagram `docs/wiring/wiring.svg` to standard output.

use std::fmt::Write as _;

const WIDTH: i32 = 1120;
const HEIGHT: i32 = 700;

/// Connection between a pin of the Uno and a neighbouring device.
struct Connection {
    y: i32,
    device: &'static str,
    uno: &'static str,
    colour: &'static str,
    /// Label along the connection.
    part: &'static str,
}

const fn wire(
    y: i32,
    device: &'static str,
    uno: &'static str,
    colour: &'static str,
    part: &'static str,
) -> Connection {
    Connection { y, device, uno, colour, part }
}

const SIGNAL: &str = "#1f6fb2";
const GROUND: &str = "#333333";
const POWER: &str = "#c0392b";

const LEFT: [Connection; 6] = [
    wire(150, "INIT", "D9", SIGNAL, "10 kΩ to GND"),
    wire(195, "ECHO", "D8", SIGNAL, "4.7 kΩ to +5 V"),
    wire(240, "BINH", "D10", SIGNAL, ""),
    wire(285, "BLNK", "D11", SIGNAL, ""),
    wire(330, "GND", "GND", GROUND, "short and thick"),
    wire(375, "V+", "", POWER, "1000 µF to GND, at the module"),
];
const DRIVER: [Connection; 5] = [
    wire(150, "STEP", "D4", SIGNAL, ""),
    wire(195, "DIR", "D5", SIGNAL, ""),
    wire(240, "ENABLE", "D6", SIGNAL, "10 kΩ to +5 V"),
    wire(285, "GND", "GND", GROUND, ""),
    wire(330, "VDD", "5V", POWER, ""),
];
const SWITCHES: [Connection; 2] = [
    wire(450, "index sensor", "A0", SIGNAL, "low at the index"),
    wire(500, "emergency stop", "A1", SIGNAL, "opens when pressed"),
];

fn main() {
    print!("{}", drawing());
}

fn drawing() -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"15\">\n\
         <title>Wiring of a sonard ranger</title>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>\n"
    );
    text(&mut svg, 40, 46, "start", 22, "Wiring of a sonard ranger");
    text(
        &mut svg,
        40,
        72,
        "start",
        15,
        "Arduino Uno (ATmega328P, 5 V), SensComp 6500 module, stepper driver (A4988 or DRV8825)",
    );
    block(&mut svg, 40, 110, 200, 300, "6500 module");
    block(&mut svg, 470, 110, 180, 430, "Arduino Uno");
    block(&mut svg, 880, 110, 200, 250, "stepper driver");
    block(&mut svg, 880, 410, 200, 130, "switches to GND");
    for connection in &LEFT {
        draw(&mut svg, connection, 240, 470, true);
    }
    for connection in DRIVER.iter().chain(&SWITCHES) {
        draw(&mut svg, connection, 650, 880, false);
    }
    block(&mut svg, 40, 470, 200, 70, "transducer");
    line(&mut svg, 140, 410, 140, 470, POWER);
    text(&mut svg, 152, 446, "start", 14, "400 V: shielded cable");
    text(&mut svg, 560, 385, "middle", 14, "D13: status light");
    text(&mut svg, 560, 410, "middle", 14, "USB: 115200 bit/s");
    let notes = [
        "V+ of the module: its own supply, 5 V, at least 2.5 A peak. Not the Uno's 5 V pin: the module draws 2 A while it fires.",
        "Motor supply (8 to 35 V) to VMOT of the driver with its 100 µF, RESET and SLEEP to VDD; all grounds meet at one point.",
        "The resistors at INIT and ENABLE keep the module silent and the motor free while the Uno restarts.",
        "DANGER: 400 V on the transducer, stored after power-off. Cover its contacts; wait a minute before touching.",
    ];
    for (y, note) in (590..).step_by(27).zip(notes) {
        text(&mut svg, 40, y, "start", 15, note);
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw(svg: &mut String, connection: &Connection, from: i32, to: i32, device_left: bool) {
    let y = connection.y;
    let supply = connection.uno.is_empty();
    let end = if supply { from + 60 } else { to };
    line(svg, from, y, end, y, connection.colour);
    if supply {
        text(svg, end + 8, y + 5, "start", 14, "+5 V, 2.5 A");
    }
    let (device_x, device_anchor, uno_x, uno_anchor) = if device_left {
        (from - 10, "end", to + 10, "start")
    } else {
        (to + 10, "start", from - 10, "end")
    };
    text(svg, device_x, y + 5, device_anchor, 15, connection.device);
    text(svg, uno_x, y + 5, uno_anchor, 15, connection.uno);
    if !connection.part.is_empty() {
        let above = if supply { y + 25 } else { y - 8 };
        text(svg, from + 14, above, "start", 13, connection.part);
    }
}

fn block(svg: &mut String, x: i32, y: i32, width: i32, height: i32, name: &str) {
    let _ = writeln!(
        svg,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"8\" \
         fill=\"#f3f6f9\" stroke=\"#5b6b7a\" stroke-width=\"2\"/>"
    );
    text(svg, x + width / 2, y + 24, "middle", 16, name);
}

fn line(svg: &mut String, x1: i32, y1: i32, x2: i32, y2: i32, colour: &str) {
    let _ = writeln!(
        svg,
        "<path d=\"M{x1} {y1}L{x2} {y2}\" stroke=\"{colour}\" stroke-width=\"3\" fill=\"none\"/>"
    );
}

fn text(svg: &mut String, x: i32, y: i32, anchor: &str, size: i32, label: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" font-size=\"{size}\" \
         fill=\"#1b2733\">{label}</text>"
    );
}

#[cfg(test)]
mod tests {
    use super::drawing;

    #[test]
    fn diagram_is_current() {
        assert!(
            drawing() == include_str!("../../../../docs/wiring/wiring.svg"),
            "docs/wiring/wiring.svg is outdated: see docs/wiring/README.md for the command"
        );
    }
}
