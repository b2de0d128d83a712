"""The good streams of receivers' drivers for the live campaign, and the nodes that decode them."""
import math
import os
import time

import rospy
from geometry_msgs.msg import TwistStamped, TwistWithCovarianceStamped
from sensor_msgs.msg import NavSatFix

import campaign
import fake_gpsd
import fault_graph
from fault_rigs import START_S, Rig, Stream
import driver_messages as driver

FIRST_UTC = 1522344207       # 2018-03-29 17:23:27
FIRST_TIME_OF_WEEK = 408225  # s, of the same instant
LATITUDE, LONGITUDE = 48.1374, 11.5755
GPS_FIX = driver.types("gps_common/GPSFix", driver.GPS_FIX)["GPSFix"]


class ReceiverStream(Stream):
    """Solutions of a receiver, five a second. `makers`: {topic: what makes its message of a stamp}."""

    period = 0.2
    steps = 5
    warm_steps = 20

    def topics(self):
        return list(self.makers())

    def make(self, topic, later_s=0.0):
        makers = self.makers()
        if topic not in makers:
            return super().make(topic, later_s)
        message = makers[topic](self.since(later_s))
        if hasattr(message, "header"):
            message.header.stamp, message.header.frame_id = self.utc(later_s), "gps"
        return message

    def makers(self):
        raise NotImplementedError

    def since(self, later_s):
        """s, since the first solution."""
        return self.now + later_s - START_S

    def utc(self, later_s):
        return rospy.Time.from_sec(max(0.0, FIRST_UTC + self.since(later_s)))


def gps_fix(since_s, **fields):
    return GPS_FIX(latitude=LATITUDE, longitude=LONGITUDE, altitude=520.0, track=90.0, speed=2.0,
                   time=FIRST_UTC + since_s, err_horz=5.0, err_vert=8.0, err_speed=0.5, **fields)


def nav_sat_fix(_):
    message = NavSatFix(latitude=LATITUDE, longitude=LONGITUDE, altitude=520.0, position_covariance_type=2)
    message.position_covariance = [4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0]
    return message


class UbloxStream(ReceiverStream):
    pvt = driver.types("ublox_msgs/NavPVT", driver.NAV_PVT)["NavPVT"]
    sat = driver.types("ublox_msgs/NavSAT", driver.NAV_SAT)
    info = driver.types("ublox_msgs/NavSVINFO", driver.NAV_SVINFO)

    def makers(self):
        space = "ublox_gps/"
        return {space + "navpvt": self.solution, space + "navsat": self.satellites, space + "navsvinfo": self.channels,
                space + "fix": nav_sat_fix, space + "fix_velocity": lambda _: TwistWithCovarianceStamped()}

    @staticmethod
    def week_ms(since_s):
        return int(round(1e3 * (FIRST_TIME_OF_WEEK + since_s))) % 604800000

    def solution(self, since_s):
        whole = math.floor(since_s)
        date = time.gmtime(FIRST_UTC + whole)
        return self.pvt(iTOW=self.week_ms(since_s), year=date.tm_year, month=date.tm_mon, day=date.tm_mday,
                        hour=date.tm_hour, min=date.tm_min, sec=date.tm_sec, nano=int(1e9 * (since_s - whole)), valid=7,
                        fixType=3, flags=1, flags2=0xE0, lon=int(1e7 * LONGITUDE), lat=int(1e7 * LATITUDE),
                        height=520000, hAcc=2461, vAcc=4843, velN=-23, velE=2000, sAcc=361)

    def satellites(self, since_s):
        each = self.sat["NavSAT_SV"]
        return self.sat["NavSAT"](iTOW=self.week_ms(since_s), version=1, numSvs=2, sv=[
            each(gnssId=0, svId=5, cno=25, elev=13, azim=60, prRes=179, flags=6428),
            each(gnssId=6, svId=3, cno=38, elev=40, azim=200, prRes=0, flags=7)])

    def channels(self, since_s):
        each = self.info["NavSVINFO_SV"]
        return self.info["NavSVINFO"](iTOW=self.week_ms(since_s), numCh=1, sv=[each(svid=5, flags=1, cno=30, elev=20)])


class GpsdClientStream(ReceiverStream):
    status = driver.types("gps_common/GPSStatus", driver.GPS_STATUS + driver.HEADER)["GPSStatus"]

    def makers(self):
        return {"extended_fix": gps_fix, "status": lambda _: self.status(
            satellite_visible_prn=[5, 70, 305], satellite_visible_z=[30, 80, 45],
            satellite_visible_azimuth=[10, 100, 300], satellite_visible_snr=[40, 30, 35])}


class NmeaStream(ReceiverStream):
    kind = driver.types("nmea_msgs/Sentence", driver.SENTENCE)["Sentence"]

    def makers(self):
        return {"nmea_sentence": self.sentence}

    def sentence(self, since_s):
        instant = FIRST_UTC + since_s
        clock = time.strftime("%H%M%S", time.gmtime(instant)) + ".%02d" % int(100.0 * (instant % 1.0))
        return self.kind(sentence=driver.with_checksum(
            "GPGGA,%s,4808.2440,N,01134.5300,E,1,08,1.0,520.0,M,0.0,M,," % clock))


class SeptentrioStream(ReceiverStream):
    def makers(self):
        return {"septentrio_gnss/gpsfix": lambda since_s: gps_fix(
            since_s, position_covariance=[4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0], position_covariance_type=2)}


class NovatelStream(ReceiverStream):
    track = driver.types("novatel_gps_msgs/Trackstat", driver.TRACKSTAT)
    view = driver.types("novatel_gps_msgs/Gpgsv", driver.GPGSV)

    def makers(self):
        satellite, channel = self.view["Satellite"], self.track["TrackstatChannel"]
        return {"gps": gps_fix,
                "gpgsv": lambda _: self.view["Gpgsv"](n_msgs=1, msg_number=1, n_satellites=1, satellites=[
                    satellite(prn=5, elevation=40, azimuth=50, snr=42)]),
                "trackstat": lambda _: self.track["Trackstat"](channels=[
                    channel(prn=5, c_no=45.0, psr_res=1.5, reject="GOOD"),
                    channel(prn=40, ch_tr_status=1 << 16, c_no=38.0, psr_res=-2.5, reject="LOWPOWER")])}


class MavrosStream(ReceiverStream):
    def makers(self):
        return {"mavros/global_position/raw/fix": nav_sat_fix,
                "mavros/global_position/raw/gps_vel": lambda _: TwistStamped()}


class GpsdStream(ReceiverStream):
    """Reports of gpsd itself."""

    def makers(self):
        return {topic: lambda since_s, topic=topic: fake_gpsd.good_reports(
            self.text(FIRST_UTC + since_s), LATITUDE, LONGITUDE)[topic]
            for topic in ("reports/gst", "reports/sky", "reports/tpv", "reports/line")}

    @staticmethod
    def text(instant):
        return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(instant)) + ".%03dZ" % int(1e3 * (instant % 1.0))


def receiver_rigs():
    """One for each preset, and gpsd_node with a gpsd of our own."""
    def rig(name, stream):
        return Rig(name, stream, [fault_graph.Node("receiver_node", "/%s/receiver" % name, {"receiver": name})],
                   {"/%s/gps/fix" % name: "count"})

    port = fault_graph.free_port()
    server = fault_graph.Node(os.path.join(campaign.ROOT, "dev", "fake_gpsd.py"), "/gpsd_node/server", {"port": port})
    client = fault_graph.Node("gpsd_node", "/gpsd_node/gpsd", {
        "port": port, "expert/settle_time": 0.05, "expert/reconnect_period": 0.1})
    return [rig("ublox", UbloxStream), rig("gpsd", GpsdClientStream), rig("nmea", NmeaStream),
            rig("septentrio", SeptentrioStream), rig("novatel", NovatelStream), rig("mavros", MavrosStream),
            Rig("gpsd_node", GpsdStream, [server, client], {"/gpsd_node/gps/fix": "count"})]
