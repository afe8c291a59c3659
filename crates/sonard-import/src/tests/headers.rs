//! Inference of columns from their names, and the options offered if that fails.

use super::*;

fn mapped(header: &str, row: &str) -> Result<Imported, ImportError> {
    let unchecked = Assumptions { skip_checks: true, ..assumptions() };
    examine(format!("{header}\n{row}\n{row}\n").as_bytes(), Mapping::default(), unchecked)
}

fn fields(found: &Imported) -> String {
    let columns = found.mapping.columns.iter();
    columns.map(|(field, column)| format!("{field}={column}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn infers_clear_names() {
    for (header, expected) in [
        ("angle_deg,min_range_m,max_range_m,range_m", "azimuth_deg=`angle_deg` range_m=`range_m`"),
        ("pan_deg,tilt_deg,distance_cm", "azimuth_deg=`pan_deg` range_cm=`distance_cm`"),
        ("yaw_deg,pitch_deg,distance_cm", "azimuth_deg=`yaw_deg` range_cm=`distance_cm`"),
        (
            "angle_deg,distance_cm,echo_x_cm,echo_y_cm",
            "azimuth_deg=`angle_deg` range_cm=`distance_cm`",
        ),
        ("Winkel_deg,Entfernung_cm,Kommentar", "azimuth_deg=`Winkel_deg` range_cm=`Entfernung_cm`"),
    ] {
        let row = vec!["1"; header.split(',').count()].join(",");
        assert_eq!(fields(&mapped(header, &row).expect(header)), expected);
    }
    let found = mapped("heading_deg,angle_cw_deg,distance_cm", "0,10,100").expect("clear");
    assert!(
        found.mapping.clockwise && found.notes.join(" ").contains("clockwise"),
        "{:?}",
        found.notes
    );
}

/// Offered options are complete, use the file's own names, and give correct readings.
#[test]
fn offered_options_are_accepted() {
    for (header, row, offered) in [
        (
            "angle_deg,min_range,max_range,range",
            "1,0.02,4.0,1.5",
            "azimuth_deg=angle_deg,range_m=range",
        ),
        ("Lage [deg],Messwert [cm]", "1,150", "azimuth_deg=Lage [deg],range_cm=Messwert [cm]"),
        ("a,\"b (cm, raw)\",angle_deg", "1,150,2", "azimuth_deg=angle_deg,range_cm=2"),
    ] {
        let message = error_text(mapped(header, row));
        let typed = if offered.contains(' ') { format!("'{offered}'") } else { offered.to_owned() };
        assert!(message.contains(&format!("--columns {typed}")), "{message}");
        let text = format!("{header}\n{row}\n");
        let found = import(&text, columns(offered)).expect(header);
        assert_eq!(pings(&found)[0].range_m.map(|range_m| (range_m * 1e3).round()), Some(1500.0));
    }
    let message = error_text(mapped(
        "%time,field.min_range,field.max_range,field.range",
        "1462946345463606605,0.02,4.0,0.8",
    ));
    assert!(
        message.contains("range_m=field.range")
            && message.contains("--azimuth-deg")
            && !message.contains("=field.min"),
        "{message}"
    );
}

#[test]
fn fixed_ranger_needs_no_direction() {
    let text = "time_ms,distance_cm\n1000,120\n1100,130\n";
    let message = error_text(examine(text.as_bytes(), Mapping::default(), assumptions()));
    assert!(message.contains("--azimuth-deg DEG"), "{message}");
    let fixed = Mapping { azimuth_deg: Some(90.0), ..Mapping::default() };
    let found = import(text, fixed).expect("answered");
    let read: Vec<_> = pings(&found).iter().map(|ping| (ping.azimuth_deg, ping.range_m)).collect();
    assert_eq!(read.len(), 2);
    assert!(read.iter().all(|(azimuth_deg, range_m)| *azimuth_deg == 90.0 && range_m.is_some()));
}

/// Rows with one range per ranger, with and without names.
#[test]
fn array_rows_are_rounds() {
    let array = sonard_model::array::RangerArray::preset("pioneer-8").expect("shipped");
    let of_array = || Assumptions {
        array: Some(array.clone()),
        sensor: "pioneer".to_owned(),
        max_range_m: 6.8,
        ..assumptions()
    };
    let rows = "1.50\t2.50\t4.10\t4.20\t4.30\t4.40\t2.00\t1.00\n1.51\t2.49\t4.10\t4.20\t4.30\t4.40\t2.00\t1.01\n";
    let message = error_text(examine(rows.as_bytes(), Mapping::default(), of_array()));
    assert!(message.contains("8 values") && message.contains("--columns range_m=1-8"), "{message}");
    let names: Vec<String> = (0..8).map(|at| format!("sonar_{at}_m")).collect();
    let named = format!("{}\n{rows}", names.join("\t"));
    for (text, mapping) in
        [(rows.to_owned(), columns("range_m=1-8")), (named.clone(), Mapping::default())]
    {
        let found = examine(text.as_bytes(), mapping, of_array()).expect("rounds");
        assert_eq!((found.readings, found.echoes), (16, 16));
        let scans: Result<Vec<_>, _> = found.scans(text.as_bytes()).expect("as before").collect();
        let records: Vec<Record> = scans.expect("as before").into_iter().flatten().collect();
        assert_eq!(starts(&records).len(), 2);
        let first = &pings(&records)[0];
        assert_eq!((first.azimuth_deg, first.ranger.is_some()), (90.0, true));
        assert!((first.range_m.expect("an echo") - 1.5).abs() < 1e-12);
    }
    let message = error_text(examine(named.as_bytes(), Mapping::default(), assumptions()));
    assert!(
        message.contains("8 columns are ranges")
            && message.contains("--array NAME --columns range_m=1-8"),
        "{message}"
    );
    let message = error_text(examine(rows.as_bytes(), columns("range_m=1-7"), of_array()));
    assert!(message.contains("7 ranges") && message.contains("8 rangers"), "{message}");
}

#[test]
fn offers_the_right_quantity() {
    for (header, row, offered) in [
        ("angle_deg,duration_us,distance_cm", "1,8700,150", "range_cm=distance_cm"),
        ("angle_deg,duration_us,distance_cm", "1,8700,150", "tof_us=duration_us"),
        ("angle_deg,time_us", "1,8700", "azimuth_deg=angle_deg,tof_us=time_us"),
        ("yaw,dist_cm", "1,150", "azimuth_deg=yaw,range_cm=dist_cm"),
        ("angle_deg,value", "1,150", "range_cm=value"),
        ("angle_deg,distance_cm,distance_cm", "1,150,3", "azimuth_deg=angle_deg,range_cm=3"),
        ("angle_deg,one_way_tof_us", "1,4300", "give a file with ranges or times of flight"),
    ] {
        let message = error_text(mapped(header, row));
        assert!(message.contains(offered), "{header}: {message}");
        assert!(!message.contains("max"), "{message}");
    }
    let names = "field.angle_min,field.angle_max,field.angle_increment,field.ranges0,field.ranges1";
    let message = error_text(mapped(names, "-1,1,2,1.0,1.1"));
    assert!(
        message.contains("LaserScan in columns") && message.contains("without -p"),
        "{message}"
    );
}
