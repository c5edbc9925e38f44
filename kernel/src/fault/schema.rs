//! The form of a fault on the link. By hand: the derived one does not know `usize`, which postcard writes as any other
//! whole number without a sign.

use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType, NamedValue, NamedVariant};

use super::FaultKind;
use crate::exec::ExecFault;

const AXIS: &NamedValue =
    &NamedValue { name: "axis", ty: &NamedType { name: "usize", ty: &DataModelType::Usize } };

const fn unit(name: &'static str) -> NamedVariant {
    NamedVariant { name, ty: &DataModelVariant::UnitVariant }
}

const fn of_axis(name: &'static str) -> NamedVariant {
    NamedVariant { name, ty: &DataModelVariant::StructVariant(&[AXIS]) }
}

impl<R: Schema> Schema for FaultKind<R> {
    const SCHEMA: &'static NamedType = &NamedType {
        name: "FaultKind",
        ty: &DataModelType::Enum(&[
            &NamedVariant { name: "Executor", ty: &DataModelVariant::NewtypeVariant(ExecFault::SCHEMA) },
            &NamedVariant {
                name: "FollowingError",
                ty: &DataModelVariant::StructVariant(&[
                    AXIS,
                    &NamedValue { name: "error_mm", ty: R::SCHEMA },
                ]),
            },
            &of_axis("EncoderLost"),
            &NamedVariant {
                name: "EncoderJump",
                ty: &DataModelVariant::StructVariant(&[AXIS, &NamedValue { name: "jump_mm", ty: R::SCHEMA }]),
            },
            &of_axis("Runaway"),
            &of_axis("Saturated"),
            &of_axis("SoftLimit"),
            &NamedVariant {
                name: "SetpointJump",
                ty: &DataModelVariant::StructVariant(&[AXIS, &NamedValue { name: "jump_mm", ty: R::SCHEMA }]),
            },
            &of_axis("NotFinite"),
            &unit("Encoder"),
            &unit("Inputs"),
            &unit("Output"),
            &unit("Enable"),
            &unit("EmergencyStop"),
            &of_axis("Drive"),
            &of_axis("DriveNotReady"),
            &of_axis("LimitSwitch"),
            &unit("TickOverrun"),
            &NamedVariant {
                name: "TickMissed",
                ty: &DataModelVariant::StructVariant(&[&NamedValue { name: "ticks", ty: u32::SCHEMA }]),
            },
        ]),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of every variant and its fields, and their order, are those of the enumeration.
    #[test]
    fn the_form_is_that_of_the_enumeration() {
        let DataModelType::Enum(variants) = FaultKind::<f64>::SCHEMA.ty else { panic!("no enumeration") };
        // Zeros are a first variant, axis 0, 0 mm.
        let mut count = 0;
        for number in 0_u8.. {
            let bytes = [&[number][..], &[0; 16]].concat();
            let Ok(kind) = postcard::from_bytes::<FaultKind<f64>>(&bytes) else { break };
            let variant = variants[usize::from(number)];
            let fields = match variant.ty {
                DataModelVariant::UnitVariant => String::new(),
                DataModelVariant::NewtypeVariant(inner) => {
                    let DataModelType::Enum(inner) = inner.ty else { panic!("{}", inner.name) };
                    format!("({})", inner[0].name)
                }
                DataModelVariant::StructVariant(fields) => {
                    let value = |ty: &NamedType| if *ty == *f64::SCHEMA { "0.0" } else { "0" };
                    let fields: Vec<_> =
                        fields.iter().map(|field| format!("{}: {}", field.name, value(field.ty))).collect();
                    format!(" {{ {} }}", fields.join(", "))
                }
                DataModelVariant::TupleVariant(_) => panic!("{}", variant.name),
            };
            assert_eq!(format!("{kind:?}"), format!("{}{fields}", variant.name));
            count += 1;
        }
        assert_eq!(count, variants.len());
    }
}
