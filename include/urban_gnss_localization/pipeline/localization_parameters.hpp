#pragma once

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/datum_initializer.hpp"
#include "urban_gnss_localization/gnss/residual_check.hpp"
#include "urban_gnss_localization/motion/imu_heading.hpp"
#include "urban_gnss_localization/pipeline/bias_matcher.hpp"
#include "urban_gnss_localization/pipeline/fix_delay.hpp"
#include "urban_gnss_localization/pipeline/input_parameters.hpp"
#include "urban_gnss_localization/pipeline/integrity_monitor.hpp"
#include "urban_gnss_localization/pipeline/speed_source.hpp"
#include "urban_gnss_localization/pipeline/start_supervisor.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"
#include "urban_gnss_localization/pipeline/velocity_queue.hpp"
#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

namespace urban_gnss {

/// How a fix waits for its satellites, and when their residuals are its own.
struct SatelliteParameters {
  double satellites_wait{0.5};
  ResidualCheckParameters residuals;

  void visit(ParameterVisitor& v) {
    v("satellites_wait", satellites_wait, non_negative(), "s",
      "time, by the odometry's stamps, that a fix waits for its gps/satellites if the fix before had some");
    v.include(residuals);
  }
};

/// All that every localizer is told beside its method's parameters, by the part of the pipeline that it is for.
struct LocalizationParameters {
  DatumParameters datum;
  InputParameters input;
  StartParameters start;
  YawRateParameters imu;
  ImuHeadingParameters imu_orientation;
  SpeedParameters speed;
  VelocityParameters velocity;
  SatelliteParameters satellites;
  FixDelayParameters fix_delay;
  BiasMatcherParameters bias;
  IntegrityParameters integrity;
  StatusParameters status;

  void visit(ParameterVisitor& v) {
    v.group("map_datum", datum, "Origin of the map frame.");
    v.include(input);
    v.group("start", start, "Start and restart of the localizer.");
    v.group("imu", imu, "Yaw rate of the IMU.");
    v.group("imu_orientation", imu_orientation, "Heading of the IMU, where its messages have an orientation.");
    v.group("speed", speed, "Speed of the odometry, and when the receiver's takes its place.");
    v.group("velocity", velocity, "Velocity of the receiver.");
    v.group("satellites", satellites, "Satellites of a fix.");
    v.include(fix_delay);
    v.group("gps_bias", bias, "Bias of a fix, where the localizer takes it from a bias filter.");
    v.group("integrity", integrity, "Long-run test of the estimate against the fixes.");
    v.group("status", status, "Criteria of the localizer's status.");
  }
};

}  // namespace urban_gnss
