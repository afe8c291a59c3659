//! Throughput of the codec and the host machine, frames per second.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use firmware_protocol::device::{Action, Board, Device, EchoReport};
use firmware_protocol::frame::{Frame, FrameDecoder, Received};
use firmware_protocol::host::{Command, Host, HostConfig, HostEvent};
use firmware_protocol::messages::{
    Blanking, Capabilities, Echoes, FirmwareVersion, Reading, ReadingStatus, Reply, Request,
    ResetCause, Settings, Sweep,
};
use sonard_benches::{HEADER, reading};

const BEAMS: u16 = 1_000;

fn codec(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("codec");
    group.throughput(Throughput::Elements(1));
    let message = Reply::Reading(reading(129));
    group.bench_function("encode a reading", |bencher| {
        bencher.iter(|| Frame::encode(HEADER, black_box(&message)));
    });
    let frame = Frame::encode(HEADER, &message).expect("fits");
    let mut decoder = FrameDecoder::new();
    group.bench_function("decode a reading", |bencher| {
        bencher.iter(|| {
            let mut found = None;
            for &byte in black_box(&frame).iter() {
                if let Received::Frame(raw) = decoder.push(byte) {
                    found = Reply::decode(raw.body).ok();
                }
            }
            found
        });
    });
    group.finish();
}

const SETTINGS: Settings = Settings {
    window_ticks: 48_000,
    min_interval_ticks: 0,
    settle_ticks: 0,
    max_echoes: 1,
    blanking: Blanking::Internal,
    speed: 2_000,
    acceleration: 40_000,
    hold_s: 0,
};

fn device() -> Device {
    Device::new(Board {
        boot: 1,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: *b"BENCH00001",
        steps_per_revolution: 400,
        capabilities: Capabilities::INDEX_SENSOR,
        reset_cause: ResetCause::PowerOn,
    })
}

/// Device and host without a line between, and a board that is done at once.
struct Pair {
    host: Host,
    device: Device,
    ticks: u32,
    readings: u32,
}

impl Pair {
    fn run(&mut self, command: Command) {
        self.host.start(self.now_us(), command).expect("free");
        while self.host.is_busy() {
            self.exchange();
        }
    }

    fn now_us(&self) -> u64 {
        u64::from(self.ticks / 2)
    }

    fn exchange(&mut self) {
        self.ticks += 2;
        while let Some(frame) = self.host.poll_transmit() {
            self.device.handle_bytes(self.ticks, &frame);
        }
        self.device.handle_timeout(self.ticks);
        if let Some(action) = self.device.poll_action() {
            self.perform(action);
        }
        let mut buffer = [0; 66];
        let count = self.device.poll_transmit(&mut buffer);
        let now_us = self.now_us();
        self.host.handle_bytes(now_us, &buffer[..count]);
        self.host.handle_timeout(now_us);
        while let Some(event) = self.host.poll_event() {
            self.readings += u32::from(matches!(event, HostEvent::Reading { .. }));
        }
    }

    fn perform(&mut self, action: Action) {
        match action {
            Action::Home { .. } => self.device.handle_homed(self.ticks, Ok(0)),
            Action::Move { target, .. } => self.device.handle_moved(self.ticks, target),
            Action::Fire { .. } => self.device.handle_echoes(
                self.ticks,
                &EchoReport {
                    fired_ticks: self.ticks,
                    status: ReadingStatus::Echo,
                    echoes: Echoes::from_ticks(&[9_652]),
                },
            ),
            Action::StopMotion | Action::ReleaseCoils | Action::AbortFire | Action::Reset => {}
        }
    }
}

fn machines(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("machines");
    group.throughput(Throughput::Elements(u64::from(BEAMS)));
    let host = Host::new(HostConfig::new(115_200, 1));
    let mut pair = Pair { host, device: device(), ticks: 0, readings: 0 };
    pair.run(Command::Identify);
    pair.run(Command::Configure(SETTINGS));
    pair.run(Command::Home);
    let plan = Sweep {
        sweep: 0,
        first_step: 0,
        stride: 1,
        stops: BEAMS,
        pings_per_stop: 1,
        lease_ms: 10_000,
    };
    group.bench_function("device and host, a sweep of 1000 readings", |bencher| {
        bencher.iter(|| {
            pair.readings = 0;
            pair.run(Command::Sweep(plan));
            assert_eq!(pair.readings, u32::from(BEAMS));
        });
    });
    group.bench_function("host, 1000 readings", |bencher| {
        let prepared = prepared_sweep(&pair, plan);
        bencher.iter(|| {
            let (mut host, frames) = prepared.clone();
            let mut readings = 0;
            for frame in &frames {
                host.handle_bytes(0, frame);
                host.poll_transmit();
                while let Some(event) = host.poll_event() {
                    readings += u32::from(matches!(event, HostEvent::Reading { .. }));
                }
            }
            assert_eq!(readings, u32::from(BEAMS));
        });
    });
    group.finish();
}

/// A host that has begun a sweep, and all the frames that it will get.
fn prepared_sweep(pair: &Pair, plan: Sweep) -> (Host, Vec<Frame>) {
    let mut host = pair.host.clone();
    host.start(pair.now_us(), Command::Sweep(plan)).expect("free");
    let frame = host.poll_transmit().expect("a request");
    let mut decoder = FrameDecoder::new();
    let mut sent = None;
    for &byte in frame.iter() {
        if let Received::Frame(raw) = decoder.push(byte) {
            sent = Some((raw.header, Request::decode(raw.body)));
        }
    }
    let Some((header, Ok(Request::Sweep(sweep)))) = sent else { panic!("no Sweep was sent") };
    let frames = (0..BEAMS).map(|index| {
        let reading = Reading { sweep: sweep.sweep, ..reading(index) };
        Frame::encode(header, &Reply::Reading(reading)).expect("fits")
    });
    (host, frames.collect())
}

criterion_group!(benches, codec, machines);
criterion_main!(benches);
