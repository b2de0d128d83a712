"""Small stand-ins of drivers' messages: the names and types of the fields, made from texts, as no driver is there."""
from genpy.dynamic import generate_dynamic

BETWEEN = "\n" + 80 * "=" + "\nMSG: "
HEADER = BETWEEN + "std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"

NAV_PVT = """# a comment
uint8 CLASS_ID = 1
uint32 iTOW  # [ms]
uint16 year
uint8 month
uint8 day
uint8 hour
uint8 min
uint8 sec
uint8 valid
int32 nano
uint8 fixType
uint8 flags
uint8 flags2
int32 lon
int32 lat
int32 height
uint32 hAcc
uint32 vAcc
int32 velN
int32 velE
int32 velD
uint32 sAcc
"""
NAV_SAT = ("uint32 iTOW\nuint8 version\nuint8 numSvs\nuint8[2] reserved0\nNavSAT_SV[] sv\n" + BETWEEN +
           "ublox_msgs/NavSAT_SV\nuint8 gnssId\nuint8 svId\nuint8 cno\nint8 elev\nint16 azim\nint16 prRes\n"
           "uint32 flags\n")
NAV_SVINFO = ("uint32 iTOW\nuint8 numCh\nuint8 globalFlags\nuint16 reserved2\nNavSVINFO_SV[] sv\n" + BETWEEN +
              "ublox_msgs/NavSVINFO_SV\nuint8 chn\nuint8 svid\nuint8 flags\nuint8 quality\nuint8 cno\nint8 elev\n"
              "int16 azim\nint32 prRes\n")
GPS_STATUS = """Header header
uint16 satellites_used
int32[] satellite_used_prn
uint16 satellites_visible
int32[] satellite_visible_prn
int32[] satellite_visible_z
int32[] satellite_visible_azimuth
int32[] satellite_visible_snr
int16 STATUS_NO_FIX=-1
int16 status
"""
GPS_FIX = """Header header
GPSStatus status
float64 latitude
float64 longitude
float64 altitude
float64 track
float64 speed
float64 climb
float64 time
float64 err_horz
float64 err_vert
float64 err_speed
float64[9] position_covariance
uint8 position_covariance_type
""" + HEADER + BETWEEN + "gps_common/GPSStatus\n" + GPS_STATUS
SENTENCE = "Header header\nstring sentence\n" + HEADER
TRACKSTAT = ("Header header\nstring solution_status\nstring position_type\nfloat32 cutoff\n"
             "TrackstatChannel[] channels\n" + HEADER + BETWEEN + "novatel_gps_msgs/TrackstatChannel\nint16 prn\n"
             "int16 glofreq\nuint32 ch_tr_status\nfloat64 psr\nfloat32 doppler\nfloat32 c_no\nfloat32 locktime\n"
             "float32 psr_res\nstring reject\nfloat32 psr_weight\n")
GPGSV = ("Header header\nstring message_id\nuint8 n_msgs\nuint8 msg_number\nuint8 n_satellites\n"
         "Satellite[] satellites\n" + HEADER + BETWEEN + "novatel_gps_msgs/Satellite\nuint8 prn\nuint8 elevation\n"
         "uint16 azimuth\nint8 snr\n")


def types(name, text):
    """Classes of the message and of those within it, by their names."""
    return {full.split("/")[1]: kind for full, kind in generate_dynamic(name, text).items()}


def with_checksum(body):
    checksum = 0
    for character in body:
        checksum ^= ord(character)
    return "$%s*%02X\r\n" % (body, checksum)
