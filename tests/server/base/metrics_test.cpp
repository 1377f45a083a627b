#include "server/base/metrics.h"

#include <ctime>

#include <nlohmann/json.hpp>

#include "server/base/process_metrics.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

/// The value of a series by its name and labels; nothing if it is not there.
std::optional<double> value(const std::string& scrape, const std::string& series) {
  const auto at = scrape.find("\n" + series + " ");
  if (at == std::string::npos) return std::nullopt;
  return std::stod(scrape.substr(at + series.size() + 2));
}

TEST(Metrics, ADeviceHasOneGaugeThatFollowsItsViews) {
  Metrics metrics;
  EXPECT_FALSE(value(metrics.scrape(), "catgs_device_views{device=\"0\"}"));
  metrics.set_views(0, 2);
  metrics.set_views(1, 3);
  metrics.set_views(0, 0);
  EXPECT_EQ(value(metrics.scrape(), "catgs_device_views{device=\"0\"}"), 0.0);
  EXPECT_EQ(value(metrics.scrape(), "catgs_device_views{device=\"1\"}"), 3.0);
}

TEST(Metrics, TheJsonHasWhatAScrapeHas) {
  Metrics metrics;
  metrics.set_views(1, 3);
  metrics.frames_sent.Increment(2.0);
  const auto json = nlohmann::json::parse(metrics.json());
  EXPECT_EQ(json.at("catgs_device_views"),
            nlohmann::json::parse(R"([{"labels": {"device": "1"}, "value": 3}])"));
  EXPECT_EQ(json.at("catgs_frames_sent_total").at(0).at("value"), 2.0);
  const auto& stage = json.at("catgs_frame_stage_seconds").at(0);
  EXPECT_EQ(stage.at("sum"), 0.0);
  EXPECT_TRUE(stage.at("buckets").back().at(0).is_null());
  const std::string text = metrics.scrape();
  for (const auto& [family, series] : json.items())
    EXPECT_THAT(text, HasSubstr("# TYPE " + family + " "));
}

TEST(Metrics, PagesAreCountedBySceneAndDeviceAndGoWithTheScene) {
  Metrics metrics;
  EXPECT_THAT(metrics.scrape(), Not(HasSubstr("catgs_scene_pages")));
  const PageFigures city{.device = 1,
                         .in_memory = 7,
                         .missing = 3,
                         .loaded = 9,
                         .unreadable = 2,
                         .slots = 20,
                         .free_slots = 4,
                         .pool_bytes = 6000};
  const PageFigures hall{
      .device = 1, .in_memory = 9, .slots = 20, .free_slots = 4, .pool_bytes = 6000};
  metrics.set_pages({{"city", city}, {"hall", hall}});
  const std::string text = metrics.scrape();
  for (const auto& [series, expected] : std::map<std::string, double>{
           {R"(catgs_scene_pages{scene="city",device="1",state="in_memory"})", 7},
           {R"(catgs_scene_pages{scene="city",device="1",state="missing"})", 3},
           {R"(catgs_scene_pages{scene="city",device="1",state="unreadable"})", 2},
           {R"(catgs_scene_pages{scene="hall",device="1",state="in_memory"})", 9},
           {R"(catgs_scene_pages_loaded_total{scene="city",device="1"})", 9},
           {R"(catgs_page_pool_bytes{device="1"})", 6000},
           {R"(catgs_page_pool_slots{device="1"})", 20},
           {R"(catgs_page_pool_free_slots{device="1"})", 4}})
    EXPECT_EQ(value(text, series), expected) << series;
  metrics.set_pages({{"hall", {.in_memory = 1}}});
  EXPECT_THAT(metrics.scrape(), Not(HasSubstr("scene=\"city\"")));
  EXPECT_EQ(
      value(metrics.scrape(), R"(catgs_scene_pages{scene="hall",device="cpu",state="missing"})"),
      0.0);
}

TEST(Metrics, TellsWhatTheProcessTakes) {
  const std::string text = Metrics().scrape();
  EXPECT_GT(value(text, "process_cpu_seconds_total"), 0.0);
  EXPECT_GT(value(text, "process_resident_memory_bytes"), 1e6);
#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // they have a heap of their own
  EXPECT_GT(value(text, "process_heap_bytes"), 1e4);
  HeapUse heap;
  const double before = heap.bytes();
  const std::vector<char> held(64'000'000);
  EXPECT_GT(HeapUse().bytes(), before + 64e6);
  EXPECT_EQ(heap.bytes(), before) << "twice a minute";
#endif
  EXPECT_GE(value(text, "process_open_fds"), 3.0);
  EXPECT_GE(value(text, "process_max_fds"), value(text, "process_open_fds"));
  const auto now_s = static_cast<double>(std::time(nullptr));
  EXPECT_LE(value(text, "process_start_time_seconds"), now_s + 1.0);
  EXPECT_GT(value(text, "process_start_time_seconds"), now_s - 3600.0);
}

}  // namespace
}  // namespace catgs
