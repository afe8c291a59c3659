use std::fs;

use proptest::prelude::*;

use super::{scratchpad::tests::w1_slave, *};

const ZERO_C: [u8; 8] = [0x00, 0x00, 0x4b, 0x46, 0x7f, 0xff, 0x10, 0x10];

fn temperature_c(text: &str) -> Result<f64, ThermometerFault> {
    parse(text).map(|sample| sample.temperature_c)
}

#[test]
fn both_formats_are_parsed() {
    let w1 = "72 01 4b 46 7f ff 0e 10 57 : crc=57 YES\n72 01 4b 46 7f ff 0e 10 57 t=23125\n";
    assert_eq!(temperature_c(w1), Ok(23.125));
    assert_eq!(temperature_c("-1500\n"), Ok(-1.5));
    for zero in ["0\n", "0", "00000\n", "-0\n"] {
        assert_eq!(temperature_c(zero), Ok(0.0));
    }
    assert_eq!(temperature_c("62\n"), Ok(0.062));
    assert_eq!(temperature_c("21500"), Ok(21.5));
    let zero = parse(&w1_slave(ZERO_C, 0)).expect("a true 0 C");
    assert_eq!((zero.temperature_c, zero.is_unusual), (0.0, false));
    // 23.9 C of a DS18S20, as the driver refines it.
    let ds18s20 = w1_slave([0x30, 0x00, 0x4b, 0x46, 0xff, 0xff, 0x06, 0x10], 24_375);
    assert_eq!(temperature_c(&ds18s20), Ok(24.375));
}

#[test]
fn impossible_values_are_rejected() {
    let registers = |change: &dyn Fn(&mut [u8; 8])| {
        let mut registers = ZERO_C;
        change(&mut registers);
        registers
    };
    let power_on = [0x50, 0x05, 0x4b, 0x46, 0x7f, 0xff, 0x0c, 0x10];
    for (text, part) in [
        (w1_slave([0; 8], 0), "all registers of the sensor are 00"),
        (w1_slave(power_on, 85_000), "before its first conversion"),
        ("85000".into(), "before its first conversion"),
        (w1_slave([0xff, 0x07, 0x4b, 0x46, 0x7f, 0xff, 0x01, 0x10], 127_937), "-20 to 50"),
        (w1_slave(registers(&|r| r[4] = 0), 0), "configuration 00"),
        (w1_slave([0xff; 8], -62), "configuration ff"),
        (w1_slave(ZERO_C, 23_125), "00 00 for 23.125 C"),
        (w1_slave(ZERO_C, 0).replace("YES", "NO"), "checksum"),
        (w1_slave(ZERO_C, 0).replace("4b", "4a"), "checksum"),
        ("60000\n".into(), "-20 to 50"),
        ("-127000\n".into(), "-20 to 50"),
    ] {
        let error = parse(&text).expect_err("it is rejected").to_string();
        assert!(error.contains(part), "{text:?}: {error}");
    }
    // A copy of the sensor with other values in reserved registers.
    let copy = w1_slave([0x90, 0x01, 0x55, 0x05, 0x7f, 0x7e, 0x81, 0x66], 25_000);
    assert!(parse(&copy).expect("it measures").is_unusual);
}

#[test]
fn malformed_text_is_rejected() {
    let cut = w1_slave(ZERO_C, 0);
    for (text, part) in [
        ("", "empty"),
        ("\n", "empty"),
        ("NaN\n", "\"NaN\" is not a number"),
        ("21", "the end of the line"),
        ("00", "the end of the line"),
        ("warm", "not a number"),
        ("2.1e4", "not a number"),
        ("99999999999999999999", "not a number"),
        (&cut[..20], "not a number"),
        (&cut[..cut.find("t=").expect("there")], "cut off"),
        (&cut[..cut.find("t=").expect("there") + 2], "cut off"),
        ("00 00 4b : crc=00 YES\n t=0\n", "a register is missing"),
    ] {
        let error = parse(text).expect_err("it is rejected").to_string();
        assert!(error.contains(part), "{text:?}: {error}");
    }
}

proptest! {
    #[test]
    fn any_text_is_handled(text in "(?s).{0,200}") {
        if let Ok(sample) = parse(&text) {
            prop_assert!((-20.0..=50.0).contains(&sample.temperature_c));
        }
    }

    #[test]
    fn truncated_w1_slave_is_rejected(counts in -320..800_i16, cut in 2..200_usize) {
        let [low, high] = counts.to_le_bytes();
        let thousandths = i32::from(counts) * 1000 / 16;
        let whole = w1_slave([low, high, 0x4b, 0x46, 0x7f, 0xff, 0x0c, 0x10], thousandths);
        let expected = f64::from(thousandths) / 1e3;
        prop_assert_eq!(temperature_c(&whole), Ok(expected));
        if let Ok(read) = temperature_c(whole.get(..cut).unwrap_or(&whole)) {
            prop_assert!((read - expected).abs() <= 0.07, "{} for {}", read, expected);
        }
    }
}

#[tokio::test]
async fn other_files_do_not_block() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("folder")).expect("a folder");
    rustix::fs::mknodat(
        rustix::fs::CWD,
        path("pipe"),
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RUSR,
        0,
    )
    .expect("a pipe");
    let _socket = std::os::unix::net::UnixListener::bind(path("socket")).expect("a socket");
    fs::write(path("huge"), vec![b'1'; 1 << 20]).expect("a file");
    fs::write(path("binary"), [0, 159, 146, 150]).expect("a file");
    std::os::unix::fs::symlink("loop", path("loop")).expect("a link");
    for (name, part) in [
        ("folder", "a folder"),
        ("pipe", "a named pipe"),
        ("socket", "No such device"),
        ("huge", "too long"),
        ("binary", "not a text"),
        ("missing", "No such file"),
        ("loop", "symbolic links"),
    ] {
        let began = Instant::now();
        let error = Thermometer::new(path(name)).read().await.expect_err("it is rejected");
        let text = error.to_string();
        assert!(text.contains(part) && text.contains(name), "{text}");
        assert!(began.elapsed() < Duration::from_secs(2), "{name}");
    }
    let error = Thermometer::new("/dev/zero").read().await.expect_err("it is rejected");
    assert!(error.to_string().contains("a device"), "{error}");
}

#[tokio::test]
async fn internal_chip_is_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let read = |file: &str| {
        let file = path(file);
        async move { Thermometer::new(file).read().await }
    };
    fs::write(path("temp1_input"), "41000\n").expect("a file");
    fs::write(path("temp"), "41000\n").expect("a file");
    assert_eq!(read("temp1_input").await, Ok(41.0), "without a name it may be anything");
    for chip in ["coretemp", "k10temp", "cpu_thermal", "nvme", "iwlwifi_1", "acpitz"] {
        fs::write(path("name"), format!("{chip}\n")).expect("a file");
        fs::write(path("type"), format!("{chip}\n")).expect("a file");
        for file in ["temp1_input", "temp"] {
            let error = read(file).await.expect_err("no air").to_string();
            assert!(error.contains(chip) && error.contains("does not measure the air"), "{error}");
        }
    }
    for chip in ["sht3x", "bme280", "lm75", "w1_slave_temp"] {
        fs::write(path("name"), format!("{chip}\n")).expect("a file");
        assert_eq!(read("temp1_input").await, Ok(41.0), "{chip}");
    }
    let mut thermometer = Thermometer::new(path("temp1_input"));
    thermometer.read().await.expect("the air's");
    fs::write(path("name"), "tmp102\n").expect("a file");
    let error = thermometer.read().await.expect_err("renumbered").to_string();
    assert!(error.contains("tmp102 now and to w1_slave_temp before"), "{error}");
}

#[tokio::test]
async fn last_valid_value_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("w1_slave");
    fs::write(&file, "21000\n").expect("a file");
    let mut thermometer = Thermometer::new(&file);
    assert_eq!(thermometer.last_valid(), None);
    assert_eq!(thermometer.read().await, Ok(21.0));
    for bad in [w1_slave([0; 8], 0), w1_slave(ZERO_C, 0), "85000\n".into(), String::new()] {
        fs::write(&file, &bad).expect("a file");
        thermometer.read().await.expect_err("rejected");
        let (last_c, age) = thermometer.last_valid().expect("kept");
        assert_eq!(last_c, 21.0);
        assert!(age > RETRY_PAUSE, "{age:?}");
    }
    fs::write(&file, "21500\n").expect("a file");
    assert_eq!(thermometer.read().await, Ok(21.5));
    assert_eq!(thermometer.take_remark(), None);
}
