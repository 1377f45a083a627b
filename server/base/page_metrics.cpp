#include "server/base/page_metrics.h"

#include <cstdint>
#include <map>
#include <utility>

namespace catgs {
namespace {

using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<prometheus::ClientMetric::Label>;

void add(MetricFamily& family, Labels labels, std::uint64_t value) {
  prometheus::ClientMetric metric;
  metric.label = std::move(labels);
  (family.type == MetricType::Counter ? metric.counter.value : metric.gauge.value) =
      static_cast<double>(value);
  family.metric.push_back(std::move(metric));
}

std::string device_of(const PageFigures& figures) {
  return figures.device ? std::to_string(*figures.device) : "cpu";
}

}  // namespace

std::vector<MetricFamily> page_metrics(const std::vector<ScenePages>& all) {
  MetricFamily pages{"catgs_scene_pages",
                     "Pages of a scene in pages: in_memory; missing, which would refine the "
                     "pictures of its sessions, summed over these; unreadable, which were asked "
                     "for and are damaged",
                     MetricType::Gauge,
                     {}};
  MetricFamily loaded{"catgs_scene_pages_loaded_total",
                      "Pages that were read since the scene came into memory",
                      MetricType::Counter,
                      {}};
  MetricFamily bytes{"catgs_page_pool_bytes",
                     "Memory for the pages of all scenes in pages",
                     MetricType::Gauge,
                     {}};
  MetricFamily slots{
      "catgs_page_pool_slots", "Pages that this memory holds", MetricType::Gauge, {}};
  MetricFamily free{
      "catgs_page_pool_free_slots", "Pages that it has room for now", MetricType::Gauge, {}};
  std::map<std::string, const PageFigures*> pools;
  for (const auto& [scene, figures] : all) {
    const std::string device = device_of(figures);
    pools[device] = &figures;
    const auto labels = [&, &id = scene](const char* state) {
      return Labels{{"scene", id}, {"device", device}, {"state", state}};
    };
    add(pages, labels("in_memory"), figures.in_memory);
    add(pages, labels("missing"), figures.missing);
    add(pages, labels("unreadable"), figures.unreadable);
    add(loaded, {{"scene", scene}, {"device", device}}, figures.loaded);
  }
  for (const auto& [device, figures] : pools) {
    add(bytes, {{"device", device}}, figures->pool_bytes);
    add(slots, {{"device", device}}, figures->slots);
    add(free, {{"device", device}}, figures->free_slots);
  }
  if (pools.empty()) return {};
  return {std::move(pages), std::move(loaded), std::move(bytes), std::move(slots), std::move(free)};
}

}  // namespace catgs
