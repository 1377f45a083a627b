#include "server/base/metrics.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include <nlohmann/json.hpp>
#include <prometheus/text_serializer.h>

#include "render_core/base/build_info.h"
#include "server/base/log.h"
#include "server/base/process_metrics.h"

namespace catgs {
namespace {

using prometheus::Histogram;

// From a tenth of a frame at 120 Hz to a frozen picture.
const Histogram::BucketBoundaries latency_buckets_s = {
    0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.033, 0.066, 0.1, 0.15, 0.25, 0.5, 1.0, 2.0};

}  // namespace

Metrics::Metrics() {
  gauge("catgs_build_info", "Always 1; the labels tell the build",
        {{"version", build_version}, {"commit", build_commit}})
      .Set(1.0);
}

prometheus::Gauge& Metrics::gauge(const char* name, const char* help,
                                  const prometheus::Labels& labels) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry_).Add(labels);
}

prometheus::Gauge& Metrics::budget(const char* resource) {
  return gauge(
      "catgs_budget_used_ratio",
      "Share of processors and GPUs that the sessions take at --min-fps, as measured; at 1 "
      "admission ends",
      {{"resource", resource}});
}

prometheus::Counter& Metrics::counter(const char* name, const char* help,
                                      const prometheus::Labels& labels) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry_).Add(labels);
}

prometheus::Histogram& Metrics::stage(const char* name) {
  return prometheus::BuildHistogram()
      .Name("catgs_frame_stage_seconds")
      .Help(
          "Duration of a frame's stages: queue_wait (it could start, others' turns came first), "
          "hand_off (to the thread that renders), render, encode_wait (to the "
          "thread that encodes), encode, send (encoded to handed to the socket)")
      .Register(registry_)
      .Add({{"stage", name}}, latency_buckets_s);
}

prometheus::Histogram& Metrics::latency(const char* name, const char* help) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry_).Add(
      {}, latency_buckets_s);
}

std::vector<prometheus::MetricFamily> Metrics::families() const {
  auto families = registry_.Collect();
  std::ranges::move(process_metrics(), std::back_inserter(families));
  {
    const std::lock_guard lock(pages_mutex_);
    std::ranges::move(page_metrics(pages_), std::back_inserter(families));
  }
  prometheus::ClientMetric lost;
  lost.counter.value = static_cast<double>(log_lines_lost());
  families.push_back({"catgs_log_lines_lost_total",
                      "Lines that are not in the log: there were too many, or standard error did "
                      "not take them (a full disk, a pipe that nobody reads)",
                      prometheus::MetricType::Counter,
                      {lost}});
  return families;
}

std::string Metrics::scrape() const { return prometheus::TextSerializer().Serialize(families()); }

std::string Metrics::json() const {
  nlohmann::ordered_json all;
  for (const prometheus::MetricFamily& family : families())
    for (const prometheus::ClientMetric& metric : family.metric) {
      nlohmann::ordered_json series{{"labels", nlohmann::ordered_json::object()}};
      for (const auto& label : metric.label) series["labels"][label.name] = label.value;
      if (family.type == prometheus::MetricType::Histogram) {
        series["sum"] = metric.histogram.sample_sum;
        for (const auto& bucket : metric.histogram.bucket)  // the last bound, infinity, is null
          series["buckets"].push_back({bucket.upper_bound, bucket.cumulative_count});
      } else {
        const bool counts = family.type == prometheus::MetricType::Counter;
        series["value"] = counts ? metric.counter.value : metric.gauge.value;
      }
      all[family.name].push_back(std::move(series));
    }
  return all.dump();
}

void Metrics::set_views(int device, int views) {
  views_.Add({{"device", std::to_string(device)}}).Set(views);  // returns the existing gauge
}

void Metrics::set_pages(std::vector<ScenePages> pages) {
  const std::lock_guard lock(pages_mutex_);
  pages_ = std::move(pages);
}

void Metrics::set_loop_stalled(const std::string& loop, Clock::duration stalled) {
  loop_stalled_.Add({{"loop", loop}}).Set(std::chrono::duration<double>(stalled).count());
}

void Metrics::set_encoder_sessions(const std::string& encoder, int count) {
  encoder_sessions_.Add({{"encoder", encoder}}).Set(count);
}

}  // namespace catgs
