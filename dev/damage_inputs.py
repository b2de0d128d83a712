"""Small whole inputs for the tools, one of each kind, and the commands that read them. Used by damage_campaign.py."""
import json
import math
import os
import random
import struct
from collections import namedtuple

# `name` is the file that is damaged; `command` reads it, with {} for the folder that holds it and its neighbours and
# OUT for a folder of results.
Case = namedtuple("Case", "kind name command")

LATITUDE, LONGITUDE, METRES_A_DEGREE = 45.0, 7.0, 111194.0
T0 = 1700000000.0
SECONDS = 25
SCENARIO = """buildings:
  - {file: blocks.csv}
  - {footprint: [[0, 40], [20, 40], [20, 55], [0, 55]], roof: 30, base: 0, name: bank, reflection_loss: 6}
  - {box: {center: [40, 60], size: [20, 15], yaw: 0.1}, roof: 25}
  - grid: {origin: [200, 0], blocks: [2, 2], block_size: [80, 60], street_width: [18, 16], buildings_per_side: 2,
           heights: [30, 60], seed: 7, plazas: [[1, 1]]}
trees:
  - {position: [10, -16], trunk_radius: 0.2, crown_radius: 3, crown_base: 3, crown_top: 9, attenuation: 1.5}
  - {row: {from: [30, -16], to: [90, -16], spacing: 8}}
route: {track: track.csv}
cars:
  - {loop: [[-50, 3], [150, 3], [150, 80], [-50, 80]], speed: 8, phase: 0, count: 3, length: 4.5, width: 1.8,
     height: 1.5}
faults:
  - {type: spike, start: 1, duration: 2, share: 0.1, offset: [150, -80, 0]}
receiver: {rate: 5}
sky: {almanac: sky.alm}
lidar: {type: none}
"""
ALMANAC = """******** Week 377 almanac for PRN-{0:02d} ********
ID:                         {0:02d}
Health:                     000
Eccentricity:               0.6597995758E-002
Time of Applicability(s):  319488.0000
Orbital Inclination(rad):   0.9893061549
Rate of Right Ascen(r/s):  -0.7508884204E-008
SQRT(A)  (m 1/2):           5153.683594
Right Ascen at Week(rad):  {1:.6f}
Argument of Perigee(rad):  -1.781409342
Mean Anom(rad):             {2:.6f}
Af0(s):                     0.8964538574E-004
Af1(s/s):                   0.3637978807E-011
week:                        377

"""
PARAMS = """imm_ekf:
  antenna_offset: [0.3, 0.0]
  datum: [45.0, 7.0, 0.0]
  use_fix_covariance: true
  expert:
    start: {initial_pose: [0.0, 0.0, 0.0], initial_heading_sigma: 0.1}
    fix_noise: {fix_scale_rate: 0.05}
gps_bias:
  mode: paper
"""


def places():
    """(s, x, y, yaw) of a circle of 30 m at 3 m/s, ten a second."""
    for k in range(10 * SECONDS):
        t = k / 10.0
        yield t, 30.0 * math.sin(0.1 * t), 30.0 - 30.0 * math.cos(0.1 * t), 0.1 * t


def write_text(folder, name, text):
    """A text file of the folder."""
    with open(os.path.join(folder, name), "w", encoding="utf-8") as stream:
        stream.write(text)


def write_bag(path, compression):
    """What a small robot records."""
    import rosbag
    import rospy
    from geometry_msgs.msg import Quaternion, TransformStamped, TwistWithCovarianceStamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, NavSatFix
    from tf2_msgs.msg import TFMessage
    from urban_gnss_localization.msg import Satellite, SatelliteArray

    def stamped(message, t, frame):
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(T0 + t), frame
        return message

    with rosbag.Bag(path, "w", compression=compression, chunk_threshold=20000) as bag:
        def write(topic, message, t, delay=0.0):
            bag.write(topic, message, rospy.Time.from_sec(T0 + t + delay))
        mount = stamped(TransformStamped(child_frame_id="gps"), 0.0, "base_link")
        mount.transform.rotation.w = 1.0
        write("/tf_static", TFMessage([mount]), 0.0)
        for t, x, y, yaw in places():
            odometry = stamped(Odometry(child_frame_id="base_link"), t, "odom")
            odometry.pose.pose.position.x, odometry.pose.pose.position.y = x, y
            odometry.pose.pose.orientation = Quaternion(0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
            odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = 3.0, 0.1
            write("/odom", odometry, t)
            imu = stamped(Imu(), t, "base_link")
            imu.angular_velocity.z, imu.linear_acceleration.z = 0.1, 9.81
            imu.orientation_covariance[0] = -1.0
            write("/imu/data", imu, t, 0.001)
            truth = stamped(odometry, t, "map")
            write("/ground_truth/odom", truth, t, 0.002)
            if round(10 * t) % 10 == 0:
                fix = stamped(NavSatFix(latitude=LATITUDE + y / METRES_A_DEGREE, longitude=LONGITUDE + x /
                                        METRES_A_DEGREE / math.cos(math.radians(LATITUDE)), altitude=0.0), t, "gps")
                fix.position_covariance = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 4.0]
                fix.position_covariance_type = 2
                velocity = stamped(TwistWithCovarianceStamped(), t, "map")
                velocity.twist.twist.linear.x, velocity.twist.twist.linear.y = 3 * math.cos(yaw), 3 * math.sin(yaw)
                sky = stamped(SatelliteArray(), t, "gps")
                for k in range(6):
                    sky.satellites.append(Satellite(constellation=Satellite.GPS, svid=k + 1, name="G%02d" % (k + 1),
                                                    azimuth=k, elevation=0.3 + 0.1 * k, cn0=40.0, tracked=True,
                                                    used=Satellite.USED, pseudorange_residual=0.5))
                write("/gps/satellites", sky, t, 0.003)
                write("/gps/velocity", velocity, t, 0.004)
                write("/gps/fix", fix, t, 0.005)


def write_recording(folder):
    """A folder of CSV files as csv_to_bag reads it."""
    odom, truth, fixes = ["stamp,v,yaw_rate"], ["stamp,x,y,z,yaw,v"], ["stamp,lat_deg,lon_deg,alt_m,cov_xx,cov_xy,"
                                                                        "cov_yy,cov_zz"]
    sats, imu = ["stamp,sat,az,el,cn0,pr_res_wls,received"], ["stamp,wx,wy,wz,ax,ay,az"]
    for t, x, y, yaw in places():
        odom.append("%.3f,3.0,0.1" % (5000 + t))
        imu.append("%.3f,0,0,0.1,0,0,9.81" % (5000 + t))
        if round(10 * t) % 10 == 0:
            truth.append("%.3f,%.3f,%.3f,0,%.4f,3.0" % (5000 + t, x, y, yaw))
            fixes.append("%.3f,%.8f,%.8f,0.0,1.0,0.0,1.0,4.0" % (
                5000 + t, LATITUDE + y / METRES_A_DEGREE,
                LONGITUDE + x / METRES_A_DEGREE / math.cos(math.radians(LATITUDE))))
            sats += ["%.3f,G%02d,%.2f,%.2f,40.0,0.5,1" % (5000 + t, k + 1, k, 0.3 + 0.1 * k) for k in range(4)]
    for name, lines in (("odom", odom), ("truth", truth), ("gnss", fixes), ("sats", sats), ("imu", imu)):
        write_text(folder, name + ".csv", "\n".join(lines) + "\n")
    write_text(folder, "meta.json", json.dumps({"origin": {"lat_deg": LATITUDE, "lon_deg": LONGITUDE,
                                                           "ellipsoid_height_m": 0.0}}))


def write_clouds(folder):
    """A wall as .pcd in each encoding, and the table of check_visibility."""
    numbers = random.Random(1)
    points = [(10.0 + 0.05 * numbers.random(), -20 + 0.5 * i, 0.5 * k) for i in range(40) for k in range(20)]
    head = ("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA {1}\n")
    columns = b"".join(b"".join(struct.pack("<f", point[axis]) for point in points) for axis in range(3))
    literal = b"".join(bytes([len(columns[i:i + 32]) - 1]) + columns[i:i + 32] for i in range(0, len(columns), 32))
    data = {"ascii": b"".join(b"%.4f %.4f %.4f\n" % point for point in points),
            "binary": b"".join(struct.pack("<3f", *point) for point in points),
            "binary_compressed": struct.pack("<II", len(literal), len(columns)) + literal}
    for name, content in data.items():
        with open(os.path.join(folder, "wall_%s.pcd" % name), "wb") as stream:
            stream.write(head.format(len(points), name).encode() + content)
    lines = ["stamp,x,y,z,sat,az,el,mask_el,blocked_by_model,label_nlos"]
    for i in range(40):
        azimuth, elevation = 0.15 * i, 0.1 + 0.03 * i
        lines.append("%d,0,0,1,G%02d,%.4f,%.4f,0.3,%d," % (i // 10, i % 32 + 1, azimuth, elevation, elevation < 0.3))
    write_text(folder, "table.csv", "\n".join(lines) + "\n")


def write_scenario(folder):
    """A scenario with everything that it may name."""
    write_text(folder, "city.yaml", SCENARIO)
    blocks = ["building,vertex,x,y,roof_z"]
    for b in range(3):
        corners = enumerate([(0, 0), (20, 0), (20, 15), (0, 15)])
        blocks += ["%d,%d,%.2f,%.2f,%.1f" % (b, v, 30 * b + x, 10 + y, 20 + b) for v, (x, y) in corners]
    write_text(folder, "blocks.csv", "\n".join(blocks) + "\n")
    track = ["stamp,x,y"] + ["%.2f,%.3f,%.3f" % (0.1 * i, 0.5 * i, -3 + math.sin(0.05 * i)) for i in range(100)]
    write_text(folder, "track.csv", "\n".join(track) + "\n")
    write_text(folder, "sky.alm", "".join(ALMANAC.format(k + 1, 0.7 * k - 3, 0.6 * k - 3) for k in range(10)))


def write_nmea(folder):
    """A log of a receiver that stands still."""
    def sentence(text):
        total = 0
        for letter in text:
            total ^= ord(letter)
        return "$%s*%02X\r\n" % (text, total)

    lines = []
    for k in range(40):
        time = "1200%02d.00" % k
        place = "4500.%04d,N,00700.0000,E" % (k % 4)
        lines.append(sentence("GPRMC,%s,A,%s,0.0,90.0,290723,,,A" % (time, place)))
        lines.append(sentence("GPGGA,%s,%s,1,08,1.0,50.0,M,47.0,M,," % (time, place)))
        lines.append(sentence("GPGST,%s,5.0,3.0,2.0,45.0,2.5,2.5,5.0" % time))
        lines.append(sentence("GPGSV,2,1,06,01,40,083,46,02,17,308,41,12,07,344,39,14,65,120,47"))
        lines.append(sentence("GPGSV,2,2,06,22,30,210,44,25,50,270,45"))
    write_text(folder, "log.nmea", "".join(lines))


def write_all(folder):
    """Everything into one folder; the cases."""
    for compression in ("none", "bz2", "lz4"):
        write_bag(os.path.join(folder, "drive_%s.bag" % compression), compression)
    write_recording(folder)
    write_clouds(folder)
    write_scenario(folder)
    write_nmea(folder)
    write_text(folder, "params.yaml", PARAMS)
    replay = ["replay", "{}/drive_none.bag", "--tum", "OUT/o.tum", "--json", "OUT/o.json"]
    simulate = ["simulate", "--scenario", "{}/city.yaml", "--duration", "2", "--without-lidar", "--output", "OUT/o.bag",
                "--json", "OUT/o.json"]
    cases = []
    for compression in ("none", "bz2", "lz4"):
        name = "drive_%s.bag" % compression
        cases.append(Case("bag " + compression, name, ["replay", "{}/" + name, "--output", "OUT/o.bag", *replay[2:]]))
    cases += [
        Case("bag, evaluate", "drive_none.bag", ["evaluate", "{}/drive_none.bag", "--output", "OUT/e", "--no-plots",
                                                 "--estimate-topic", "/odom"]),
        Case("bag, doctor", "drive_none.bag", ["doctor", "{}/drive_none.bag", "--json", "OUT/o.json"]),
        Case("parameters", "params.yaml", replay + ["--params", "{}/params.yaml"]),
        Case("nmea", "log.nmea", ["replay", "--nmea", "{}/log.nmea", "--odom", "none", "--tum", "OUT/o.tum", "--json",
                                  "OUT/o.json"]),
        Case("nmea, decode", "log.nmea", ["decode_nmea", "{}/log.nmea"]),
        Case("nmea, calibrate", "log.nmea", ["calibrate_ure", "--nmea", "{}/log.nmea"]),
        Case("meta.json", "meta.json", ["csv_to_bag", "{}", "OUT/o.bag"])]
    cases += [Case("csv " + name, name + ".csv", ["csv_to_bag", "{}", "OUT/o.bag"])
              for name in ("odom", "gnss", "sats", "imu", "truth")]
    cases += [Case("pcd " + name, "wall_%s.pcd" % name, [
        "check_visibility", "--map", "{}/wall_%s.pcd" % name, "--table", "{}/table.csv", "--json", "OUT/o.json"])
              for name in ("ascii", "binary", "binary_compressed")]
    cases.append(Case("csv of visibility", "table.csv", ["check_visibility", "--map", "{}/wall_binary.pcd", "--table",
                                                         "{}/table.csv", "--json", "OUT/o.json"]))
    cases += [Case(kind, name, simulate) for kind, name in (
        ("scenario", "city.yaml"), ("yuma", "sky.alm"), ("csv of buildings", "blocks.csv"), ("csv of track",
                                                                                             "track.csv"))]
    return cases
