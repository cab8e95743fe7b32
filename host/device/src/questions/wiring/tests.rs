//! Against a second model of the wiring: points and wires instead of bits.

use super::*;
use std::collections::BTreeSet;
use std::convert::Infallible;

/// A board, a cable and a plug as what they are: points, and wires between them. Output drivers are points 0 to 11, the
/// plug's ends of their lines 12 to 23, the plug's ends of the inputs 24 to 28, the inputs 29 to 33, ground 34, supply 35.
/// Where levels meet, this one wins.
struct Wires(Vec<(usize, usize)>, bool);

const OUT: usize = 12;
const BACK: usize = 24;
const IN: usize = 29;
const GROUND: usize = 34;
const SUPPLY: usize = 35;

impl Wires {
    fn new() -> Wires {
        let outputs = (0..12).map(|output| (output, OUT + output));
        let inputs = (0..5).map(|input| (BACK + input, IN + input));
        Wires(outputs.chain(inputs).collect(), false)
    }

    /// With a fault, where lines that touch read as `wins` when they are driven apart.
    fn with(fault: Fault, wins: bool) -> Wires {
        let mut wires = Wires(Wires::new().0, wins);
        let swap = |wires: &mut Wires, a: usize, b: usize| {
            let (at, to) = (wires.0[a].1, wires.0[b].1);
            (wires.0[a].1, wires.0[b].1) = (to, at);
        };
        match fault {
            // A low line has lost its driver and touches ground; a high one has lost its driver.
            Fault::Output(output, high) => {
                wires.0[output] = (if high { SUPPLY } else { GROUND }, OUT + output);
            }
            Fault::Input(input, high) => {
                wires.0[12 + input] = (if high { SUPPLY } else { GROUND }, IN + input);
            }
            Fault::OutputsCrossed(a, b) => swap(&mut wires, a, b),
            Fault::InputsCrossed(a, b) => swap(&mut wires, 12 + a, 12 + b),
            Fault::OutputsTouch(a, b) => wires.0.push((OUT + a, OUT + b)),
            Fault::InputsTouch(a, b) => wires.0.push((IN + a, IN + b)),
            Fault::Touch(output, input) => wires.0.push((OUT + output, IN + input)),
        }
        wires
    }

    /// What the board reads: an input has the level that wins if that reaches it from anywhere, else the other if that
    /// does. One that nothing reaches rests high.
    fn read(&self, plug: Option<Plug>, levels: Levels) -> Lines {
        let plugged = plug.map(Plug::wires).into_iter().flat_map(|wires| wires.into_iter().zip(0..));
        let mut wires = self.0.clone();
        wires.extend(plugged.map(|(output, input): (usize, usize)| (OUT + output, BACK + input)));
        let reach = |level: bool| {
            let (from, other) = if level { (SUPPLY, GROUND) } else { (GROUND, SUPPLY) };
            let mut reached: BTreeSet<usize> =
                (0..12).filter(|output| (levels.0 >> output & 1 == 1) == level).chain([from]).collect();
            loop {
                let before = reached.len();
                for &(a, b) in &wires {
                    if a != other && (reached.contains(&a) || reached.contains(&b)) {
                        reached.extend([a, b]);
                    }
                }
                if reached.len() == before {
                    return reached;
                }
            }
        };
        let (winner, loser) = (reach(self.1), reach(!self.1));
        let is_high = |input: &i32| {
            let point = IN + *input as usize;
            if winner.contains(&point) { self.1 } else { !loser.contains(&point) || !self.1 }
        };
        let high = (0..5).filter(is_high);
        Lines(high.fold(Lines::POWER, |lines, input| lines | 1 << input))
    }

    fn seen(&self, plug: Plug) -> Seen {
        let mut probe = |levels| Ok::<_, Infallible>(self.read(Some(plug), levels));
        look(plug, &mut probe).unwrap()
    }

    fn judged(&self) -> Verdict {
        judge(&Plug::ALL.map(|plug| self.seen(plug)))
    }

    fn found(&self, plug: Option<Plug>) -> Option<Plug> {
        find(&mut |levels| Ok::<_, Infallible>(self.read(plug, levels))).unwrap()
    }
}

#[test]
fn good_wiring_is_called_good_in_every_position_and_no_plug_is_no_plug() {
    let wires = Wires::new();
    assert_eq!(wires.judged(), Verdict::Good);
    assert_eq!(wires.found(None), None);
    for plug in Plug::ALL {
        assert_eq!(wires.found(Some(plug)), Some(plug));
    }
}

#[test]
fn every_single_fault_is_named_and_no_other() {
    for (fault, wins) in faults().into_iter().flat_map(|fault| [(fault, false), (fault, true)]) {
        let wires = Wires::with(fault, wins);
        assert_eq!(wires.judged(), Verdict::One(vec![fault]), "{fault}; {wins} wins");
    }
}

#[test]
fn the_position_of_the_plug_is_found_whatever_single_fault_there_is() {
    for (fault, wins) in faults().into_iter().flat_map(|fault| [(fault, false), (fault, true)]) {
        let wires = Wires::with(fault, wins);
        assert_eq!(wires.found(None), None, "{fault}; {wins} wins");
        for plug in Plug::ALL {
            assert_eq!(wires.found(Some(plug)), Some(plug), "{fault}; {wins} wins");
        }
    }
}

#[test]
fn every_line_is_tried_in_some_position() {
    let tried: BTreeSet<usize> = Plug::ALL.iter().flat_map(|plug| plug.wires()).collect();
    assert_eq!(tried.len(), OUTPUTS.len());
}

#[test]
fn the_plug_is_found_without_a_strobe_or_a_reset() {
    find(&mut |levels: Levels| {
        assert_eq!(levels.control(), Levels::REST.control());
        Ok::<_, Infallible>(Lines(0x1f))
    })
    .unwrap();
}

#[test]
fn two_faults_at_once_name_the_lines_that_go_astray() {
    let mut wires = Wires::with(Fault::OutputsCrossed(0, 1), false);
    wires.0[12 + 4] = (GROUND, IN + 4);
    let Verdict::Several(astray) = wires.judged() else { panic!("{:?}", wires.judged()) };
    let first: Vec<_> = astray.iter().filter(|astray| astray.plug == Plug::First).collect();
    let names: Vec<_> = first.iter().map(|astray| (astray.output.name, astray.found.clone())).collect();
    assert_eq!(names, [("Data1", vec!["Busy"]), ("Data2", vec!["nAck"]), ("Data5", vec![])]);
    assert_eq!(first[0].expected, Some("nAck"));
}

#[test]
fn the_table_of_the_document_is_that_of_the_plug() {
    let text = include_str!("../../../../../docs/wiring.md");
    for (input, line) in INPUTS.iter().enumerate() {
        let outputs = Plug::ALL.map(|plug| {
            let output = OUTPUTS[plug.wires()[input]];
            format!("{} ({} / {})", output.name, output.centronics, output.db25)
        });
        let row =
            format!("| {} ({} / {}) | {} |", line.name, line.centronics, line.db25, outputs.join(" | "));
        assert!(text.contains(&row), "docs/wiring.md does not have: {row}");
    }
}

/// A constant of the firmware's module of pins.
fn firmware(name: &str) -> u8 {
    let source = include_str!("../../../../../bridge/firmware/src/pins.rs");
    let (_, rest) = source.split_once(&format!("const {name}: u8 = ")).unwrap_or_else(|| panic!("no {name}"));
    rest.split(';').next().unwrap().parse().unwrap()
}

/// The pin of a Pico's edge. Two are ground behind every eight, one on either side.
fn edge(gpio: u8) -> u8 {
    gpio + 1 + (gpio + 2) / 4
}

/// Pins of a chip's input and of the output opposite to it, counted from the first.
fn through(chip: u8, channel: u8) -> String {
    let (first, last) = if chip == 3 { (2, 18) } else { (3, 21) };
    format!("U{chip} {}, {}", first + channel, last - channel)
}

#[test]
fn the_table_of_pins_is_that_of_the_firmware_the_program_and_the_chips() {
    let text = include_str!("../../../../../docs/wiring.md");
    let table = text.split_once("## Pins").unwrap().1.split_once("| supply |").unwrap().0;
    let rows: Vec<Vec<&str>> =
        table.lines().map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect();
    let mut gpios = BTreeSet::new();
    let mut check = |name: &str, gpio: u8, chip: String, plug: String, db25: String| {
        let row = rows.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("no row for {name}"));
        let found = [row[1], row[2], row[4], row[5]];
        assert_eq!(found, [&format!("GP{gpio} ({})", edge(gpio)), &chip, &plug, &db25], "{name}");
        assert!(gpios.insert(gpio), "GP{gpio} twice");
    };
    let controls = ["STROBE", "AUTO_FEED", "INIT", "SELECT_IN"].map(firmware);
    for (line, output) in OUTPUTS.iter().zip(0..) {
        let (gpio, chip) = match output {
            0..8 => (firmware("DATA") + output, through(1, output)),
            _ => (controls[usize::from(output) - 8], through(2, output - 8)),
        };
        assert_eq!(line.gpio, gpio, "{}", line.name);
        check(line.name, gpio, chip, line.centronics.to_string(), line.db25.to_string());
    }
    for (line, input) in INPUTS.iter().zip(0..) {
        assert_eq!(line.gpio, firmware("ACK") + input, "{}", line.name);
        check(line.name, line.gpio, through(3, input), line.centronics.to_string(), line.db25.to_string());
    }
    check("+5 V", firmware("POWER"), through(3, 5), "18".into(), "-".into());
    check("nOE", firmware("ENABLE"), "U1 22 and U2 22".into(), "-".into(), "-".into());
    assert!(text.contains(&format!("GP{} stays unconnected", firmware("UNUSED"))));
    assert!(text.contains(&format!("The lamp is the Pico's own (GP{})", firmware("LAMP"))));
}
