#pragma once

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/datum_initializer.hpp"
#include "urban_gnss_localization/pipeline/bias_matcher.hpp"
#include "urban_gnss_localization/pipeline/input_parameters.hpp"
#include "urban_gnss_localization/pipeline/start_supervisor.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"
#include "urban_gnss_localization/pipeline/velocity_queue.hpp"
#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

namespace urban_gnss {

/// How a fix waits for its satellites.
struct SatelliteParameters {
  double satellites_wait{0.5};

  void visit(ParameterVisitor& v) {
    v("satellites_wait", satellites_wait, non_negative(), "s",
      "of odometry that a fix waits for its gps/satellites, where the fix before it had some");
  }
};

/// All that every localizer is told beside its method's parameters, by the part of the pipeline that it is for.
struct LocalizationParameters {
  DatumParameters datum;
  InputParameters input;
  StartParameters start;
  YawRateParameters imu;
  VelocityParameters velocity;
  SatelliteParameters satellites;
  BiasMatcherParameters bias;
  StatusParameters status;

  void visit(ParameterVisitor& v) {
    v.group("map_datum", datum, "the map frame's origin");
    v.include(input);
    v.group("start", start, "from where the localizer starts, and when it starts anew");
    v.group("imu", imu, "the IMU's yaw rate");
    v.group("velocity", velocity, "the receiver's velocity");
    v.group("satellites", satellites, "the satellites of a fix");
    v.group("gps_bias", bias, "the bias of a fix, where the localizer takes it from a bias filter");
    v.group("status", status, "when the localizer is said to be well");
  }
};

}  // namespace urban_gnss
