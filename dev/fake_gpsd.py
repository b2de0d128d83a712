#!/usr/bin/env python3
"""A gpsd for the live campaign: what comes on its topics goes to every client as a line of JSON.

Private parameter port. Topics reports/tpv, reports/sky, reports/gst (REPORTS) and reports/line (std_msgs/String, as it
is). Bytes that are no message go out as they came: a line that is no JSON. NaN and infinite are written as such, which
is no JSON either.
"""
import json
import os
import socket
import sys
import threading

import genpy
import rospy
from std_msgs.msg import String

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), "test", "ros"))
import driver_messages  # noqa: E402

DEFINITIONS = {
    "TPV": "string kind\nstring device\nint32 mode\nint32 status\nstring time\nfloat64 lat\nfloat64 lon\n"
           "float64 altHAE\nfloat64 alt\nfloat64 track\nfloat64 speed\nfloat64 epx\nfloat64 epy\nfloat64 epv\n"
           "float64 eph\nfloat64 eps\n",
    "SKY": "string kind\nstring device\nstring time\nfloat64 hdop\nfloat64 vdop\nSatellite[] satellites\n" +
           driver_messages.BETWEEN + "gpsd_reports/Satellite\nint32 PRN\nint32 gnssid\nint32 svid\nint32 sigid\n"
           "float64 az\nfloat64 el\nfloat64 ss\nbool used\nfloat64 prRes\n",
    "GST": "string kind\nstring device\nstring time\nfloat64 lon\nfloat64 lat\nfloat64 alt\n",
}
REPORTS = {name.lower(): driver_messages.types("gpsd_reports/" + name, text) for name, text in DEFINITIONS.items()}


def plain(value):
    """Of a message, what JSON can have."""
    if isinstance(value, genpy.Message):
        return {"class" if name == "kind" else name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value


def to_line(message):
    return message.data if isinstance(message, String) else json.dumps(plain(message))


class FakeGpsd:
    def __init__(self):
        self.lock, self.clients = threading.Lock(), []
        self.server = socket.socket()
        self.server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.server.bind(("localhost", rospy.get_param("~port")))
        self.server.listen(5)
        threading.Thread(target=self.accept, daemon=True).start()
        kinds = {name: types[name.upper()] for name, types in REPORTS.items()}
        kinds["line"] = String
        self.subscribers = [rospy.Subscriber("reports/" + name, rospy.AnyMsg, self.on_report, kind, queue_size=5000,
                                             tcp_nodelay=True) for name, kind in kinds.items()]

    def accept(self):
        while True:
            client, _ = self.server.accept()
            client.settimeout(5.0)  # of one that does not read
            with self.lock:
                self.clients.append(client)
            self.send(b'{"class":"VERSION","release":"3.25","proto_major":3,"proto_minor":15}\n')

    def on_report(self, message, kind):
        raw = message._buff
        try:
            line = to_line(kind().deserialize(raw)).encode(errors="replace")
        except (genpy.DeserializationError, UnicodeDecodeError, MemoryError):
            line = raw
        self.send(line + b"\n")

    def send(self, line):
        with self.lock:
            for client in list(self.clients):
                try:
                    client.sendall(line)
                except OSError:
                    client.close()
                    self.clients.remove(client)


def good_reports(time_text, latitude_deg, longitude_deg):
    """{name of the topic: message} of one solution, without a fault."""
    tpv, sky, gst = (REPORTS[name][name.upper()]() for name in ("tpv", "sky", "gst"))
    for message, name in ((tpv, "TPV"), (sky, "SKY"), (gst, "GST")):
        message.kind, message.device, message.time = name, "/dev/ttyUSB0", time_text
    tpv.mode, tpv.status, tpv.lat, tpv.lon, tpv.altHAE, tpv.alt = 3, 1, latitude_deg, longitude_deg, 520.0, 475.0
    tpv.track, tpv.speed, tpv.epx, tpv.epy, tpv.epv, tpv.eph, tpv.eps = 90.0, 2.0, 3.0, 4.0, 6.0, 5.0, 0.3
    sky.hdop, sky.vdop = 1.0, 1.6
    sky.satellites = [REPORTS["sky"]["Satellite"](PRN=5, gnssid=0, svid=5, az=110.0, el=40.0, ss=41.0, used=True),
                      REPORTS["sky"]["Satellite"](PRN=67, gnssid=6, svid=3, az=300.0, el=35.0, ss=25.0, used=False)]
    gst.lon, gst.lat, gst.alt = 2.0, 3.0, 5.0
    return {"reports/tpv": tpv, "reports/sky": sky, "reports/gst": gst, "reports/line": String(data="{}")}


if __name__ == "__main__":
    rospy.init_node("fake_gpsd")
    gpsd = FakeGpsd()
    rospy.spin()
