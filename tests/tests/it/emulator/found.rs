//! What the program finds on USB: bridges, each once, and other things, by their descriptors and names alone.

use std::fs;
use std::process::Output;

/// A bridge's descriptors as far as the program looks at them: one vendor interface with a bulk endpoint each way.
fn descriptors(vendor: u16, product: u16) -> Vec<u8> {
    let ([v0, v1], [p0, p1]) = (vendor.to_le_bytes(), product.to_le_bytes());
    vec![
        18, 1, 0, 2, 0, 0, 0, 64, v0, v1, p0, p1, 0, 0, 1, 2, 3, 1, // device
        9, 2, 32, 0, 1, 1, 0, 0x80, 50, // configuration
        9, 4, 0, 0, 2, 0xff, 0, 0, 0, 7, 5, 1, 2, 64, 0, 0, 7, 5, 0x81, 2, 64, 0, 0,
    ]
}

/// Runs the program with devices plugged in that have names but answer nothing.
fn with(devices: &[(u16, u16, &str, &str)], args: &[&str]) -> Option<Output> {
    let (_, program) = super::parts()?;
    let Some(usbfs) = std::env::var_os("FOILPRESS_USBFS") else {
        testing::needs::Need::Usb.skip("`cargo xtask emulator` found no umockdev");
        return None;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut command = std::process::Command::new(usbfs);
    for (number, (vendor, product, maker, serial)) in devices.iter().enumerate() {
        let device = folder.path().join(number.to_string());
        fs::create_dir(&device).unwrap();
        fs::write(device.join("descriptors"), descriptors(*vendor, *product)).unwrap();
        fs::write(device.join("names"), format!("{maker}\nthing\n{serial}\n")).unwrap();
        command.arg(device);
    }
    command
        .arg("--")
        .arg(program)
        .args(args)
        .env("FOILPRESS_JOBS", folder.path().join("jobs"))
        .env("FOILPRESS_PRINTERS", folder.path().join("printers"));
    Some(command.output().unwrap())
}

const TWO: [(u16, u16, &str, &str); 3] = [
    (0x1209, 1, "Foilpress", "E6614103E7453D2A"),
    (0x1209, 1, "Foilpress", "E6614103E7453D2B"),
    // The numbers are anybody's for tests.
    (0x1209, 1, "Somebody", "7"),
];

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn one_of_two_bridges_has_to_be_chosen_by_its_serial_number() {
    for args in [&["bridge", "status"][..], &["bridge", "status", "--to", "usb:"]] {
        let Some(output) = with(&TWO, args) else { return };
        let said = super::text(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("usb:E6614103E7453D2A, usb:E6614103E7453D2B"), "{said}");
        assert!(!said.contains("usb:7"), "{said}");
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn all_bridges_are_listed_and_no_other_devices_of_the_same_numbers() {
    let Some(output) = with(&TWO, &["bridge", "list", "--json"]) else { return };
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let numbers: Vec<&str> =
        all["bridges"].as_array().unwrap().iter().map(|b| b["serial_number"].as_str().unwrap()).collect();
    assert_eq!(numbers, ["E6614103E7453D2A", "E6614103E7453D2B"]);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_bridge_that_is_not_there_is_said_to_be_absent() {
    let Some(output) = with(&TWO[..1], &["bridge", "status", "--to", "usb:0123456789ABCDEF"]) else { return };
    assert!(super::text(&output).contains("nothing is there"), "{}", super::text(&output));
}
