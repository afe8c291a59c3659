//! Classification of data sent by something other than the firmware. Pure.

use super::report::Cause;

/// Share of printable characters above which bytes count as text.
const MIN_TEXT_SHARE: f64 = 0.9;
/// Leading bytes of a sent frame that identify an echo.
const MIN_ECHO_BYTES: usize = 8;
/// Maximum length of a quoted line, characters.
const MAX_QUOTE_LENGTH: usize = 60;

/// Sender on the line other than the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ForeignSender {
    LoginPrompt,
    ModemCommands,
    ModemReplies,
    Gps,
    Echo,
    OtherText,
    OtherRate,
}

impl ForeignSender {
    /// Classifies received bytes, given the sent bytes; `None` below two bytes.
    pub(super) fn classify(received: &[u8], sent: &[u8]) -> Option<Self> {
        if received.len() < 2 {
            return None;
        }
        if sent.get(..MIN_ECHO_BYTES).is_some_and(|start| contains(received, start)) {
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
            Self::ModemReplies => "a modem replies",
            Self::Gps => "a GPS receiver sends (NMEA)",
            Self::Echo => "the line returns what is sent",
            Self::OtherText => "something sends text",
            Self::OtherRate => "something sends bytes that are neither text nor frames",
        }
    }

    pub(super) const fn help(self) -> &'static str {
        match self {
            Self::LoginPrompt => {
                "a system offers its serial console here, this computer or the one at the other end: \
                 give the ranger's port; on this computer, free the port with `sudo systemctl disable --now \
                 serial-getty@PORT.service` (PORT as in ttyAMA0) and without `console=` for it in the \
                 kernel's command line"
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
                "another program runs on this board, perhaps at another line rate, or this is another \
                 device: check the port; if it is the ranger's, flash the firmware \
                 (firmware/README.md)"
            }
        }
    }
}

/// Returns the received line that identifies a sender, or else the first one.
pub(super) fn quote(received: &[u8], sender: ForeignSender) -> Option<String> {
    let text = printable(received);
    let mut lines = text.lines().map(str::trim).filter(|line| line.len() > 1);
    let reveals = |line: &&str| match sender {
        ForeignSender::LoginPrompt => is_prompt(line),
        ForeignSender::ModemCommands => is_modem_command(line),
        ForeignSender::ModemReplies => is_modem_reply(line),
        ForeignSender::Gps => is_nmea(line),
        ForeignSender::Echo | ForeignSender::OtherText | ForeignSender::OtherRate => true,
    };
    let line = lines.clone().find(reveals).or_else(|| lines.next())?;
    Some(line.chars().take(MAX_QUOTE_LENGTH).collect())
}

/// Splits received bytes into lines at anything other than text.
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
    fn senders_are_recognized() {
        let sent = [0x00, 0x05, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x00];
        for (received, sender) in [
            (
                &b"\r\nDebian GNU/Linux 13 robot ttyAMA0\r\n\r\nrobot login: "[..],
                ForeignSender::LoginPrompt,
            ),
            (b"\xffPassword: ", ForeignSender::LoginPrompt),
            (b"AT\r\nAT+GCAP\r\n", ForeignSender::ModemCommands),
            (b"at\r", ForeignSender::ModemCommands),
            (b"ATE1 E0\r", ForeignSender::ModemCommands),
            (b"\r\nOK\r\n", ForeignSender::ModemReplies),
            (b"\r\nERROR\r\n", ForeignSender::ModemReplies),
            (b"$GPGGA,123519,4807.038,N*47\r\n", ForeignSender::Gps),
            (&sent, ForeignSender::Echo),
            (b"temperature 21.5\n", ForeignSender::OtherText),
            (b"ATMOSPHERE 1013\n", ForeignSender::OtherText),
            (&[0xf8, 0x80, 0x00, 0xe6, 0x98, 0xff], ForeignSender::OtherRate),
        ] {
            let text = String::from_utf8_lossy(received);
            assert_eq!(ForeignSender::classify(received, &sent), Some(sender), "{text}");
        }
        assert_eq!(ForeignSender::classify(b"", &sent), None);
        let banner = b"Debian GNU/Linux\r\nrobot login: ";
        assert_eq!(quote(banner, ForeignSender::LoginPrompt).as_deref(), Some("robot login:"));
        assert_eq!(quote(banner, ForeignSender::OtherText).as_deref(), Some("Debian GNU/Linux"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_classified(received: Vec<u8>, sent: Vec<u8>) {
            let sender = ForeignSender::classify(&received, &sent);
            prop_assert_eq!(sender.is_none(), received.len() < 2);
            let quoted = sender.and_then(|sender| quote(&received, sender));
            prop_assert!(quoted.is_none_or(|quoted| quoted.len() <= MAX_QUOTE_LENGTH));
        }
    }
}
