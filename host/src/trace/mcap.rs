//! Ticks as MCAP, for viewers such as Foxglove and PlotJuggler.
//!
//! A channel for each quantity, one message each tick: a `motion.Number` or a `motion.Text` of Protocol Buffers, with the field
//! `value`. Time counts from tick 0 and has the length of a tick in whole nanoseconds, rounded tick by tick. The channel's metadata
//! have the unit.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use super::columns::AXIS_COLUMNS;
use super::{AxisTick, TraceRow};
use crate::simulate::RunInfo;

const ENCODING: &str = "protobuf";
const PACKAGE: &str = "motion";
const NUMBER: &str = "Number";
const TEXT: &str = "Text";
/// What comes before the one field of a message, its number 1: of a double, and of a string.
const DOUBLE_KEY: u8 = 1 << 3 | 1;
const STRING_KEY: u8 = 1 << 3 | 2;

/// A quantity along the path.
type OfPath<const N: usize> = fn(&TraceRow<N>) -> f64;

/// Where a value comes from.
enum Quantity<const N: usize> {
    Path(OfPath<N>),
    Axis(usize, fn(&AxisTick) -> f64),
}

/// A file being written, from the first tick on. A failure is kept for [`McapTicks::finish`]: it does not stop the run.
pub struct McapTicks<W: Write, const N: usize> {
    writer: Writer<NoSeek<W>>,
    tick_s: f64,
    quantities: Vec<(u16, Quantity<N>)>,
    state: u16,
    /// The bytes of one message, kept to reuse their memory.
    message: Vec<u8>,
    sequence: u32,
    failure: Option<McapError>,
}

impl<W: Write, const N: usize> McapTicks<W, N> {
    /// Begins the file: schemas and channels.
    ///
    /// # Errors
    /// It can't be written.
    pub fn new(out: W, info: &RunInfo) -> io::Result<Self> {
        Self::begin(out, info).map_err(into_io)
    }

    fn begin(out: W, info: &RunInfo) -> Result<Self, McapError> {
        let options = WriteOptions::new().library(concat!("motion ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.disable_seeking(true).create(NoSeek::new(out))?;
        let mut schema =
            |name: &str| writer.add_schema(&format!("{PACKAGE}.{name}"), ENCODING, &descriptors());
        let (number, text) = (schema(NUMBER)?, schema(TEXT)?);
        let mut channel = |schema: u16, topic: &str, unit: &str| {
            let unit = BTreeMap::from([("unit".to_owned(), unit.to_owned())]);
            writer.add_channel(schema, topic, ENCODING, &unit)
        };
        let of_path: [(&str, &str, OfPath<N>); 7] = [
            ("s_mm", "mm", |row| row.s_mm),
            ("v_mm_s", "mm/s", |row| row.v_mm_s),
            ("a_mm_s2", "mm/s²", |row| row.a_mm_s2),
            ("j_mm_s3", "mm/s³", |row| row.j_mm_s3),
            ("snap_mm_s4", "mm/s⁴", |row| row.snap_mm_s4),
            ("contour_um", "µm", |row| row.contour_um),
            ("line", "", |row| f64::from(row.line)),
        ];
        let mut quantities = Vec::new();
        for (name, unit, of) in of_path {
            quantities.push((channel(number, &format!("/path/{name}"), unit)?, Quantity::Path(of)));
        }
        for (place, axis) in info.axes.iter().enumerate() {
            for column in &AXIS_COLUMNS {
                let unit = (column.unit)(axis.unit());
                let topic = format!("/axis/{}/{}_{unit}", axis.name, column.quantity);
                quantities.push((channel(number, &topic, &unit)?, Quantity::Axis(place, column.of)));
            }
        }
        let state = channel(text, "/state", "")?;
        let message = Vec::new();
        Ok(Self { writer, tick_s: info.tick_s, quantities, state, message, sequence: 0, failure: None })
    }

    /// Adds a tick, or keeps its failure.
    pub fn add(&mut self, row: &TraceRow<N>) {
        if self.failure.is_none() {
            self.failure = self.put(row).err();
        }
    }

    fn put(&mut self, row: &TraceRow<N>) -> Result<(), McapError> {
        let Self { writer, quantities, message, sequence, .. } = self;
        // Thousands of years fit.
        let time_ns = (row.tick as f64 * self.tick_s * 1e9).round() as u64;
        let header = |channel_id| MessageHeader {
            channel_id,
            sequence: *sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        for (channel, quantity) in quantities {
            let value = match quantity {
                Quantity::Path(of) => of(row),
                Quantity::Axis(place, of) => of(&row.axes[*place]),
            };
            message.clear();
            message.push(DOUBLE_KEY);
            message.extend(value.to_le_bytes());
            writer.write_to_known_channel(&header(*channel), message)?;
        }
        message.clear();
        message.push(STRING_KEY);
        // Words are shorter than a byte of length tells.
        message.push(row.state.len().min(127) as u8);
        message.extend(row.state.bytes().take(127));
        writer.write_to_known_channel(&header(self.state), message)?;
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    /// Ends the file; returns what it was written to.
    ///
    /// # Errors
    /// It, or a tick before, can't be written.
    pub fn finish(mut self) -> io::Result<W> {
        if let Some(failure) = self.failure.take() {
            return Err(into_io(failure));
        }
        self.writer.finish().map_err(into_io)?;
        Ok(self.writer.into_inner().into_inner())
    }
}

/// What the messages are.
fn descriptors() -> Vec<u8> {
    let message = |name: &str, of: Type| DescriptorProto {
        name: Some(name.to_owned()),
        field: vec![FieldDescriptorProto {
            name: Some("value".to_owned()),
            number: Some(1),
            label: Some(Label::Optional.into()),
            r#type: Some(of.into()),
            json_name: Some("value".to_owned()),
            ..FieldDescriptorProto::default()
        }],
        ..DescriptorProto::default()
    };
    let file = FileDescriptorProto {
        name: Some("motion.proto".to_owned()),
        package: Some(PACKAGE.to_owned()),
        message_type: vec![message(NUMBER, Type::Double), message(TEXT, Type::String)],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

fn into_io(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use mcap::MessageStream;

    use super::*;
    use crate::machine::Machine;

    /// What a viewer reads is what was written: every quantity of every tick, with its time, its unit and the type that the schema
    /// says.
    #[test]
    fn a_viewer_reads_every_quantity_of_every_tick() {
        let mut info = RunInfo::of_machine(&Machine::reference());
        info.tick_s = 1.0 / 3000.0;
        let axis = |place: usize, tick: u64| AxisTick {
            set_mm: place as f64 + tick as f64 * 1e-3,
            err_um: -0.1 * tick as f64,
            out_v: 0.0,
            ..AxisTick::default()
        };
        let row = |tick: u64| TraceRow::<3> {
            tick,
            s_mm: 0.1 + tick as f64,
            v_mm_s: -1.5,
            a_mm_s2: 1e5,
            j_mm_s3: f64::MIN_POSITIVE,
            snap_mm_s4: 4e5,
            state: if tick == 7 { "held" } else { "moving" },
            line: 12,
            contour_um: 0.25,
            axes: [0, 1, 2].map(|place| axis(place, tick)),
        };
        let mut ticks = McapTicks::<_, 3>::new(Vec::new(), &info).expect("memory");
        (5..1005).for_each(|tick| ticks.add(&row(tick)));
        let bytes = ticks.finish().expect("memory");
        let (mut seen, mut states) = (BTreeMap::<String, Vec<(u64, f64)>>::new(), Vec::new());
        for message in MessageStream::new(&bytes).expect("MCAP") {
            let message = message.expect("whole");
            let channel = &message.channel;
            let schema = channel.schema.as_ref().expect("a schema");
            let set = FileDescriptorSet::decode(&*schema.data).expect("descriptors");
            let name = schema.name.strip_prefix("motion.").expect("of the package");
            let described = set.file[0].message_type.iter().find(|message| message.name() == name);
            let field = &described.expect("described").field[0];
            assert_eq!((&*schema.encoding, &*channel.message_encoding), ("protobuf", "protobuf"));
            assert_eq!((field.name(), field.number()), ("value", 1));
            // As Protocol Buffers' own library reads it.
            match field.r#type() {
                Type::Double => {
                    let value = f64::decode(&*message.data).expect("a double");
                    seen.entry(channel.topic.clone()).or_default().push((message.log_time, value));
                }
                Type::String => states.push(String::decode(&*message.data).expect("a string")),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(seen.len(), 7 + 3 * AXIS_COLUMNS.len());
        for (topic, of) in [
            ("/path/s_mm", (|row| row.s_mm) as OfPath<3>),
            ("/path/v_mm_s", |row| row.v_mm_s),
            ("/path/a_mm_s2", |row| row.a_mm_s2),
            ("/path/j_mm_s3", |row| row.j_mm_s3),
            ("/path/snap_mm_s4", |row| row.snap_mm_s4),
            ("/path/contour_um", |row| row.contour_um),
            ("/path/line", |row| f64::from(row.line)),
            ("/axis/Y/set_mm", |row| row.axes[1].set_mm),
            ("/axis/Z/err_um", |row| row.axes[2].err_um),
            ("/axis/X/out_v", |row| row.axes[0].out_v),
        ] {
            let expected = (5..1005).map(|tick| ((tick * 1_000_000 + 1) / 3, of(&row(tick))));
            assert_eq!(seen[topic], expected.collect::<Vec<_>>(), "{topic}");
        }
        assert_eq!(states.len(), 1000);
        assert_eq!((states[1].as_str(), states[2].as_str()), ("moving", "held"));
    }

    /// A disk that is full is told at the end.
    #[test]
    fn a_failure_is_kept_for_the_end() {
        struct Full(usize);
        impl Write for Full {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let info = RunInfo::of_machine(&Machine::reference());
        let mut ticks = McapTicks::<_, 3>::new(Full(100_000), &info).expect("room for the head");
        let row = |tick: u64| TraceRow::<3> {
            tick,
            s_mm: (tick as f64).sin(),
            v_mm_s: (tick as f64).cos(),
            a_mm_s2: (tick as f64).tan(),
            j_mm_s3: 0.0,
            snap_mm_s4: 0.0,
            state: "moving",
            line: 0,
            contour_um: 0.0,
            axes: [AxisTick::default(); 3],
        };
        (0..50_000).for_each(|tick| ticks.add(&row(tick)));
        let failed = ticks.finish().map(|_| ()).expect_err("a full disk");
        assert_eq!(failed.kind(), io::ErrorKind::StorageFull, "{failed}");
    }
}
