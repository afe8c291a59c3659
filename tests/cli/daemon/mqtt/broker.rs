//! A broker with the part of MQTT 3.1.1 that these tests need, correct or faulty.

use std::{
    io::{self, Read as _, Write as _},
    net::{Shutdown, TcpListener, TcpStream},
    sync::{Arc, Mutex, MutexGuard},
    thread,
    time::Duration,
};

/// Behaviour of a broker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Manner {
    /// Correct.
    Honest,
    /// Takes everything and acknowledges nothing.
    Deaf,
    /// Closes each connection at once.
    Curt,
    /// Closes each connection after it acknowledged so many messages.
    Short(usize),
    /// Sends what is no MQTT.
    Garbled,
    /// Sends signs of life without an end.
    Noisy,
    /// Sends messages without a subscription, endlessly.
    Pushy,
    /// As [`Self::Pushy`], with messages larger than any command.
    Bulky,
    /// Refuses user and password.
    Refusing,
    /// Closes a connection at a message whose payload is longer, bytes.
    Limited(usize),
    /// Closes a connection at a message to a topic of this ending.
    Denying(&'static str),
    /// Closes the connections of other clients when one connects: they have the same id.
    Unique,
}

/// Published message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Published {
    pub(super) topic: String,
    pub(super) payload: Vec<u8>,
    pub(super) is_retained: bool,
}

/// Fields of a client's CONNECT packet.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Introduction {
    pub(super) id: String,
    pub(super) will: Option<(String, Vec<u8>, bool)>,
    pub(super) user: Option<String>,
    pub(super) password: Option<Vec<u8>>,
    pub(super) keep_alive_s: u16,
    pub(super) is_clean: bool,
}

#[derive(Debug, Default)]
pub(super) struct ReceivedMessages {
    pub(super) introductions: Vec<Introduction>,
    /// In the order they came in, those that came twice included.
    pub(super) published: Vec<Published>,
    pub(super) subscriptions: Vec<String>,
    /// Clients that left in order.
    pub(super) goodbyes: usize,
    clients: Vec<TcpStream>,
}

/// The broker, until it is dropped.
pub(super) struct Broker {
    pub(super) port: u16,
    received: Arc<Mutex<ReceivedMessages>>,
    manner: Arc<Mutex<Manner>>,
}

impl Broker {
    pub(super) fn start(manner: Manner) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let (received, manner) = (Arc::default(), Arc::new(Mutex::new(manner)));
        let (ears, mood) = (Arc::clone(&received), Arc::clone(&manner));
        thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let (ears, manner) = (Arc::clone(&ears), *mood.lock().expect("no panic"));
                thread::spawn(move || drop(serve(stream, manner, &ears)));
            }
        });
        Self { port, received, manner }
    }

    /// Settings of a daemon that sends here.
    pub(super) fn settings(&self) -> [String; 4] {
        let broker = format!("mqtt.broker=mqtt://127.0.0.1:{}", self.port);
        ["--set".into(), broker, "--set".into(), "fleet.robot=kiwi".into()]
    }

    /// Behaves otherwise from now on, towards new clients.
    pub(super) fn become_(&self, manner: Manner) {
        *self.manner.lock().expect("no panic") = manner;
        for client in self.received().clients.drain(..) {
            drop(client.shutdown(Shutdown::Both));
        }
    }

    pub(super) fn received(&self) -> MutexGuard<'_, ReceivedMessages> {
        self.received.lock().expect("no panic")
    }

    /// Returns the messages of a topic.
    pub(super) fn of(&self, topic: &str) -> Vec<Published> {
        self.received().published.iter().filter(|one| one.topic == topic).cloned().collect()
    }

    /// Publishes a command to the last client.
    pub(super) fn publish(&self, topic: &str, payload: &[u8], flags: u8) {
        let mut packet = string(topic);
        // At least once, as number 7.
        packet.extend([0, 7]);
        packet.extend(payload);
        let mut client = self.received().clients.last().expect("a client").try_clone().expect("it");
        send(&mut client, 0x32 | flags, &packet).expect("it listens");
    }
}

fn serve(
    mut stream: TcpStream,
    manner: Manner,
    received: &Mutex<ReceivedMessages>,
) -> io::Result<()> {
    if manner == Manner::Curt {
        return Ok(());
    }
    let (_, hello) = receive(&mut stream)?;
    let lock = || received.lock().expect("no panic");
    lock().introductions.push(introduction(&hello));
    let code = if manner == Manner::Refusing { 4 } else { 0 };
    send(&mut stream, 0x20, &[0, code])?;
    let own = stream.try_clone()?;
    {
        let mut received = lock();
        if manner == Manner::Unique {
            for client in received.clients.drain(..) {
                drop(client.shutdown(Shutdown::Both));
            }
        }
        received.clients.push(own);
    }
    match manner {
        Manner::Garbled => loop {
            stream.write_all(&[0xff; 1 << 16])?;
        },
        Manner::Noisy => loop {
            stream.write_all(&[0xd0, 0].repeat(1 << 12))?;
        },
        Manner::Pushy => loop {
            send(&mut stream, 0x30, &[&string("a")[..], &[b'x'; 32_000]].concat())?;
        },
        Manner::Bulky => loop {
            send(&mut stream, 0x30, &[&string("a")[..], &[b'x'; 64_000]].concat())?;
        },
        _ => {}
    }
    let mut left = if let Manner::Short(most) = manner { most } else { usize::MAX };
    loop {
        let (kind, body) = receive(&mut stream)?;
        match kind >> 4 {
            3 => {
                let (topic, rest) = take_string(&body);
                let (number, payload) = rest.split_at(2);
                let is_refused = match manner {
                    Manner::Limited(bytes) => payload.len() > bytes,
                    Manner::Denying(ending) => topic.ends_with(ending),
                    _ => false,
                };
                if is_refused {
                    return stream.shutdown(Shutdown::Both);
                }
                lock().published.push(Published {
                    topic,
                    payload: payload.into(),
                    is_retained: kind & 1 == 1,
                });
                if left == 0 {
                    return stream.shutdown(Shutdown::Both);
                }
                left -= 1;
                if manner != Manner::Deaf {
                    send(&mut stream, 0x40, number)?;
                }
            }
            8 => {
                lock().subscriptions.push(take_string(&body[2..]).0);
                send(&mut stream, 0x90, &[body[0], body[1], 1])?;
            }
            12 => send(&mut stream, 0xd0, &[])?,
            14 => lock().goodbyes += 1,
            _ => {}
        }
    }
}

/// A packet: the first byte of its head, and its body.
fn receive(stream: &mut TcpStream) -> io::Result<(u8, Vec<u8>)> {
    let mut byte = [0];
    stream.read_exact(&mut byte)?;
    let kind = byte[0];
    let (mut length, mut shift) = (0, 0);
    loop {
        stream.read_exact(&mut byte)?;
        length |= usize::from(byte[0] & 0x7f) << shift;
        shift += 7;
        if byte[0] & 0x80 == 0 {
            break;
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body)?;
    Ok((kind, body))
}

fn send(stream: &mut TcpStream, kind: u8, body: &[u8]) -> io::Result<()> {
    let mut packet = vec![kind];
    let mut length = body.len();
    loop {
        let more = length >> 7;
        packet.push((length & 0x7f) as u8 | if more > 0 { 0x80 } else { 0 });
        length = more;
        if length == 0 {
            break;
        }
    }
    packet.extend(body);
    stream.set_write_timeout(Some(Duration::from_secs(20)))?;
    stream.write_all(&packet)
}

fn string(text: &str) -> Vec<u8> {
    [&(text.len() as u16).to_be_bytes()[..], text.as_bytes()].concat()
}

fn take(bytes: &[u8]) -> (&[u8], &[u8]) {
    let length = usize::from(u16::from_be_bytes([bytes[0], bytes[1]]));
    bytes[2..].split_at(length)
}

fn take_string(bytes: &[u8]) -> (String, &[u8]) {
    let (text, rest) = take(bytes);
    (String::from_utf8(text.into()).expect("text"), rest)
}

fn introduction(body: &[u8]) -> Introduction {
    let (_, rest) = take(body);
    let flags = rest[1];
    let keep_alive_s = u16::from_be_bytes([rest[2], rest[3]]);
    let (id, mut rest) = take_string(&rest[4..]);
    let mut field = |is_there: bool| {
        is_there.then(|| {
            let (field, behind) = take(rest);
            rest = behind;
            field.to_vec()
        })
    };
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    let (topic, message) = (field(flags & 4 != 0), field(flags & 4 != 0));
    let will = topic.zip(message).map(|(topic, message)| (text(topic), message, flags & 0x20 != 0));
    let (user, password) = (field(flags & 0x80 != 0).map(text), field(flags & 0x40 != 0));
    Introduction { id, will, user, password, keep_alive_s, is_clean: flags & 2 != 0 }
}
