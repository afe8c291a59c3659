//! Classification of what something other than the firmware sends. Pure.

use super::report::Cause;

/// Share of printable characters from which bytes count as text.
const MIN_TEXT_SHARE: f64 = 0.9;
/// Bytes of a frame that an echo must repeat.
const MIN_ECHO: usize = 8;
/// Characters that are quoted.
const MAX_QUOTED: usize = 60;

/// Something that sends on the line in place of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Speaker {
    LoginPrompt,
    ModemCommands,
    ModemReplies,
    Gps,
    Echo,
    OtherText,
    OtherRate,
}

impl Speaker {
    /// Classifies received bytes, given those that were sent; `None` if there are too few.
    pub(super) fn classify(received: &[u8], sent: &[u8]) -> Option<Self> {
        if received.len() < 2 {
            return None;
        }
        if sent.get(..MIN_ECHO).is_some_and(|start| contains(received, start)) {
            return Some(Self::Echo);
        }
        let text = printable(received);
        let mut lines = text.lines().map(str::trim);
        let printable = received.iter().filter(|byte| is_text(**byte)).count();
        Some(if lines.clone().any(is_prompt) {
            Self::LoginPrompt
        } else if lines.clone().any(is_modem_command) {
            Self::ModemCommands
        } else if lines.clone().any(is_modem_reply) {
            Self::ModemReplies
        } else if lines.any(is_nmea) {
            Self::Gps
        } else if printable as f64 >= MIN_TEXT_SHARE * received.len() as f64 {
            Self::OtherText
        } else {
            Self::OtherRate
        })
    }

    pub(super) const fn cause(self) -> Cause {
        match self {
            Self::LoginPrompt => Cause::LoginPrompt,
            Self::ModemCommands | Self::ModemReplies => Cause::Modem,
            Self::Echo => Cause::Echo,
            Self::Gps | Self::OtherText | Self::OtherRate => Cause::WrongFirmware,
        }
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::LoginPrompt => "a login prompt is on the line",
            Self::ModemCommands => "modem commands (AT...) are on the line",
            Self::ModemReplies => "a modem answers",
            Self::Gps => "a GPS receiver sends (NMEA)",
            Self::Echo => "the line returns what is sent",
            Self::OtherText => "something sends text",
            Self::OtherRate => "something sends bytes that are no text and no frames",
        }
    }

    pub(super) const fn help(self) -> &'static str {
        match self {
            Self::LoginPrompt => {
                "a system offers its serial console here, this computer or one at the other end: \
                 give the ranger's port; on this computer `sudo systemctl disable --now \
                 serial-getty@PORT.service` (PORT as in ttyAMA0) and no `console=` for it in the \
                 kernel's command line free the port"
            }
            Self::ModemCommands => {
                "a program looks for a modem: `sudo systemctl stop ModemManager`, and install \
                 systemd/60-sonard.rules, which excludes the board; if the commands come from the \
                 other end, this is another device's port"
            }
            Self::ModemReplies => {
                "this is a modem's port: give the ranger's (`sonard doctor` lists them)"
            }
            Self::Gps => {
                "this is a GPS receiver's port: give the ranger's (`sonard doctor` lists them)"
            }
            Self::Echo => {
                "TX and RX touch each other, or the device at the other end echoes (a terminal or a \
                 modem): check the wires and the port"
            }
            Self::OtherText => {
                "another program runs on this board, or this is another device: check the port; if \
                 it is the ranger's, flash the firmware (firmware/README.md)"
            }
            Self::OtherRate => {
                "another program runs on this board, at another line rate perhaps, or this is another \
                 device: check the port; if it is the ranger's, flash the firmware \
                 (firmware/README.md)"
            }
        }
    }
}

/// The received line that reveals a speaker, else the first one, for quoting.
pub(super) fn quote(received: &[u8], speaker: Speaker) -> Option<String> {
    let text = printable(received);
    let mut lines = text.lines().map(str::trim).filter(|line| line.len() > 1);
    let reveals = |line: &&str| match speaker {
        Speaker::LoginPrompt => is_prompt(line),
        Speaker::ModemCommands => is_modem_command(line),
        Speaker::ModemReplies => is_modem_reply(line),
        Speaker::Gps => is_nmea(line),
        Speaker::Echo | Speaker::OtherText | Speaker::OtherRate => true,
    };
    let line = lines.clone().find(reveals).or_else(|| lines.next())?;
    Some(line.chars().take(MAX_QUOTED).collect())
}

/// Received bytes as lines; anything else than text ends a line.
fn printable(received: &[u8]) -> String {
    received
        .iter()
        .map(|&byte| if is_text(byte) && byte != b'\r' { char::from(byte) } else { '\n' })
        .collect()
}

fn is_text(byte: u8) -> bool {
    matches!(byte, b'\t' | b'\n' | b'\r' | 0x20..=0x7e)
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

fn is_prompt(line: &str) -> bool {
    let lower = line.to_ascii_lowercase();
    lower.contains("login:") || lower.contains("password:")
}

fn is_modem_command(line: &str) -> bool {
    let upper = line.to_ascii_uppercase();
    upper.strip_prefix("AT").is_some_and(|rest| {
        rest.is_empty()
            || rest.starts_with([
                '+', '&', '%', '^', '$', '\\', '*', 'E', 'I', 'Z', 'D', 'H', 'Q', 'V', 'X',
            ])
    })
}

fn is_modem_reply(line: &str) -> bool {
    matches!(line, "OK" | "ERROR" | "NO CARRIER" | "RING" | "CONNECT" | "BUSY" | "NO DIALTONE")
        || ["+CME ERROR", "+CMS ERROR", "+CREG:", "+CGMI:"]
            .iter()
            .any(|start| line.starts_with(start))
}

fn is_nmea(line: &str) -> bool {
    let is_talker = line.starts_with("$G") || line.starts_with("$P") || line.starts_with("!A");
    is_talker && line.rsplit_once('*').is_some_and(|(_, sum)| u8::from_str_radix(sum, 16).is_ok())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn each_speaker_is_recognized() {
        let sent = [0x00, 0x05, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x00];
        for (received, speaker) in [
            (
                &b"\r\nDebian GNU/Linux 13 robot ttyAMA0\r\n\r\nrobot login: "[..],
                Speaker::LoginPrompt,
            ),
            (b"\xffPassword: ", Speaker::LoginPrompt),
            (b"AT\r\nAT+GCAP\r\n", Speaker::ModemCommands),
            (b"at\r", Speaker::ModemCommands),
            (b"ATE1 E0\r", Speaker::ModemCommands),
            (b"\r\nOK\r\n", Speaker::ModemReplies),
            (b"\r\nERROR\r\n", Speaker::ModemReplies),
            (b"$GPGGA,123519,4807.038,N*47\r\n", Speaker::Gps),
            (&sent, Speaker::Echo),
            (b"temperature 21.5\n", Speaker::OtherText),
            (b"ATMOSPHERE 1013\n", Speaker::OtherText),
            (&[0xf8, 0x80, 0x00, 0xe6, 0x98, 0xff], Speaker::OtherRate),
        ] {
            let text = String::from_utf8_lossy(received);
            assert_eq!(Speaker::classify(received, &sent), Some(speaker), "{text}");
        }
        assert_eq!(Speaker::classify(b"", &sent), None);
        let banner = b"Debian GNU/Linux\r\nrobot login: ";
        assert_eq!(quote(banner, Speaker::LoginPrompt).as_deref(), Some("robot login:"));
        assert_eq!(quote(banner, Speaker::OtherText).as_deref(), Some("Debian GNU/Linux"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_classified(received: Vec<u8>, sent: Vec<u8>) {
            let speaker = Speaker::classify(&received, &sent);
            prop_assert_eq!(speaker.is_none(), received.len() < 2);
            let quoted = speaker.and_then(|speaker| quote(&received, speaker));
            prop_assert!(quoted.is_none_or(|quoted| quoted.len() <= MAX_QUOTED));
        }
    }
}
