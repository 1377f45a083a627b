#include "server/schedule/pool_executor.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

/// A View that holds its pool and takes until `may_end` to end, as one does whose device is busy.
class LastingView final : public View {
 public:
  LastingView(std::shared_ptr<ThreadPool> pool, std::shared_future<void> may_end,
              std::promise<std::thread::id> ended_on)
      : pool_(std::move(pool)), may_end_(std::move(may_end)), ended_on_(std::move(ended_on)) {}
  ~LastingView() override {
    may_end_.wait();
    ended_on_.set_value(std::this_thread::get_id());
  }
  RenderStatus render(const FrameRequest&, FrameView&) noexcept override { return {}; }
  [[nodiscard]] std::size_t memory_bytes() const override { return 0; }

 private:
  std::shared_ptr<ThreadPool> pool_;
  std::shared_future<void> may_end_;
  std::promise<std::thread::id> ended_on_;
};

TEST(PoolExecutor, AStreamEndsElsewhereAndBeforeTheExecutor) {
  std::promise<void> let_end;
  std::promise<std::thread::id> ended_on;
  std::future<std::thread::id> ended = ended_on.get_future();
  auto pool = std::make_shared<ThreadPool>(1);
  const std::weak_ptr<ThreadPool> watched = pool;
  auto executor = std::make_unique<PoolExecutor>(pool);
  auto stream = std::make_shared<Stream>();
  stream->view =
      std::make_unique<LastingView>(pool, let_end.get_future().share(), std::move(ended_on));
  pool.reset();

  executor->close(std::move(stream));  // does not wait, or this test never ends
  let_end.set_value();
  executor.reset();
  ASSERT_EQ(ended.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  EXPECT_NE(ended.get(), std::this_thread::get_id());
  EXPECT_TRUE(watched.expired());  // joined here: a worker cannot join itself
}

/// Says which threads it was drawn and encoded on.
class WatchedView final : public View {
 public:
  explicit WatchedView(std::thread::id* on, int device = 0) : on_(on), device_(device) {}
  RenderStatus render(const FrameRequest&, FrameView&) noexcept override {
    *on_ = std::this_thread::get_id();
    return {};
  }
  [[nodiscard]] std::size_t memory_bytes() const override { return 0; }
  [[nodiscard]] std::optional<int> device() const override { return device_; }

 private:
  std::thread::id* on_;
  int device_;
};

class WatchedEncoder final : public Encoder {
 public:
  explicit WatchedEncoder(std::thread::id* on) : on_(on) {}
  EncodeStatus encode(const FrameView&, bool, EncodedFrame&) noexcept override {
    *on_ = std::this_thread::get_id();
    return {};
  }
  void set_rate(int, int) noexcept override {}
  [[nodiscard]] Codec codec() const override { return Codec::h264; }
  [[nodiscard]] std::string_view name() const override { return "watched"; }
  [[nodiscard]] std::string codec_string() const override { return ""; }

 private:
  std::thread::id* on_;
};

std::unique_ptr<Encoder> refuse(EncoderKind, const EncoderSettings&) {
  throw std::runtime_error("no session left");
}

FrameResult drawn(PoolExecutor& executor, const std::shared_ptr<Stream>& stream,
                  FrameJob job = {}) {
  std::promise<FrameResult> done;
  job.stream = stream;
  executor.submit(std::move(job), [&](FrameResult result) { done.set_value(std::move(result)); });
  return done.get_future().get();
}

TEST(PoolExecutor, OtherThreadsEncodeWhenGpusRender) {
  std::thread::id rendered_on, encoded_on;
  PoolExecutor executor({std::make_shared<ThreadPool>(3), {{0, std::make_shared<ThreadPool>(2)}}},
                        [&](EncoderKind, const EncoderSettings&) {
                          return std::make_unique<WatchedEncoder>(&encoded_on);
                        });
  EXPECT_EQ(executor.slots(), 5);
  auto stream = std::make_shared<Stream>();
  stream->view = std::make_unique<WatchedView>(&rendered_on);
  const FrameResult result = drawn(executor, stream);
  EXPECT_TRUE(result.ok);
  EXPECT_NE(rendered_on, std::thread::id());
  EXPECT_NE(encoded_on, std::thread::id());
  EXPECT_NE(rendered_on, encoded_on);
  EXPECT_LE(result.frame.ticket.render->end, result.frame.ticket.encode->start);
  executor.close(std::move(stream));
}

/// Draws depths where they are asked for.
class DeepView final : public View {
 public:
  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    frame = {};
    if (request.depth_cells.x > 0) frame.depths = {{2, 1}, inverse_depths_};
    return {};
  }
  [[nodiscard]] std::size_t memory_bytes() const override { return 0; }

 private:
  const std::vector<float> inverse_depths_{0.5f, 2.0f};
};

TEST(PoolExecutor, FramesBringTheDepthsOfTheirPicture) {
  std::thread::id on;
  PoolExecutor executor(
      {std::make_shared<ThreadPool>(1), {}},
      [&](EncoderKind, const EncoderSettings&) { return std::make_unique<WatchedEncoder>(&on); });
  auto stream = std::make_shared<Stream>();
  stream->view = std::make_unique<DeepView>();
  const auto depths_of = [&](int cells, bool refined) {
    FrameJob job;
    job.request.depth_cells = glm::ivec2(cells);
    job.ticket.refined = refined;
    return drawn(executor, stream, std::move(job)).frame.depths;
  };
  EXPECT_EQ(depths_of(0, false), nullptr);
  const auto drawn_once = depths_of(2, false);
  ASSERT_NE(drawn_once, nullptr);
  EXPECT_EQ(drawn_once->cells, glm::ivec2(2, 1));
  EXPECT_FLOAT_EQ(drawn_once->scale, 2.0f / (255.0f * 255.0f));
  EXPECT_EQ(depths_of(2, true), drawn_once) << "a refined picture is the same one";
  EXPECT_EQ(depths_of(0, false), nullptr);
  EXPECT_EQ(depths_of(0, true), nullptr);
  executor.close(std::move(stream));
}

TEST(PoolExecutor, NoGpuWaitsForFramesOfAnother) {
  std::thread::id encoded_on;
  const auto busy = std::make_shared<ThreadPool>(1);
  PoolExecutor executor(
      {std::make_shared<ThreadPool>(1), {{0, busy}, {1, std::make_shared<ThreadPool>(1)}}},
      [&](EncoderKind, const EncoderSettings&) {
        return std::make_unique<WatchedEncoder>(&encoded_on);
      });
  EXPECT_EQ(executor.slots(), 3);
  std::promise<void> let_end;
  busy->submit([may_end = let_end.get_future().share()] { may_end.wait(); });
  std::thread::id rendered_on[2];
  std::promise<bool> done[2];
  for (int device = 0; device < 2; ++device) {
    FrameJob job;
    job.stream = std::make_shared<Stream>();
    job.stream->view = std::make_unique<WatchedView>(&rendered_on[device], device);
    executor.submit(std::move(job),
                    [&, device](const FrameResult& result) { done[device].set_value(result.ok); });
  }
  EXPECT_TRUE(done[1].get_future().get());  // or this test never ends
  let_end.set_value();
  EXPECT_TRUE(done[0].get_future().get());
  EXPECT_NE(rendered_on[0], rendered_on[1]);
}

TEST(PoolExecutor, AnEncoderThatCannotBeOpenedIsTold) {
  const PoolExecutor::Pools on_gpu{std::make_shared<ThreadPool>(1),
                                   {{0, std::make_shared<ThreadPool>(1)}}};
  for (const auto& pools : {on_gpu, PoolExecutor::Pools{std::make_shared<ThreadPool>(1)}}) {
    PoolExecutor executor(pools, refuse);
    std::thread::id rendered_on;
    auto stream = std::make_shared<Stream>();
    stream->view = std::make_unique<WatchedView>(&rendered_on);
    std::promise<StreamOpened> done;
    executor.open(stream, {}, [&](StreamOpened opened) { done.set_value(std::move(opened)); });
    const StreamOpened opened = done.get_future().get();
    EXPECT_FALSE(opened.ok);
    EXPECT_EQ(opened.fault, Fault::encoder_unavailable);
    EXPECT_EQ(opened.message, "no session left");

    const FrameResult result = drawn(executor, stream);
    EXPECT_FALSE(result.ok);
    EXPECT_EQ(result.fault, Fault::encoder_unavailable);
    EXPECT_EQ(result.message, "no session left");
    EXPECT_TRUE(result.frame.ticket.render);
    EXPECT_FALSE(result.frame.ticket.encode) << "it has no encoding time";
    executor.close(std::move(stream));
  }
}

TEST(StreamEncoders, KeepsTheTwoUsedLast) {
  int opened = 0;
  std::thread::id on;
  const EncoderFactory make = [&](EncoderKind, const EncoderSettings&) {
    ++opened;
    return std::make_unique<WatchedEncoder>(&on);
  };
  EncoderSettings moving, still, other;
  moving.size_px = {640, 360};
  still.size_px = {1280, 720};
  other.size_px = {960, 540};
  StreamEncoders encoders;
  for (int i = 0; i < 100; ++i) {
    encoders.use(EncoderKind::x264, moving, make);
    encoders.use(EncoderKind::x264, still, make);
  }
  EXPECT_EQ(opened, 2) << "a camera that stops and goes opens nothing";
  const Encoder* const kept = &encoders.use(EncoderKind::x264, still, make);
  encoders.use(EncoderKind::x264, other, make);
  EXPECT_EQ(encoders.size(), 2u);
  EXPECT_EQ(&encoders.use(EncoderKind::x264, still, make), kept);
  EXPECT_EQ(opened, 3);
  encoders.use(EncoderKind::jpeg, still, make);
  EXPECT_EQ(encoders.size(), 1u) << "those of another kind serve no more";
}

TEST(StreamEncoders, NvencHasOneAtATimeAndWhatFailsHarmsNoOther) {
  std::thread::id on;
  bool fails = false;
  const EncoderFactory make = [&](EncoderKind, const EncoderSettings&) {
    if (fails) throw std::runtime_error("no memory");
    return std::make_unique<WatchedEncoder>(&on);
  };
  EncoderSettings moving, still;
  moving.size_px = {640, 360};
  still.size_px = {1280, 720};
  StreamEncoders encoders;
  encoders.use(EncoderKind::nvenc, moving, make);
  encoders.use(EncoderKind::nvenc, still, make);
  EXPECT_EQ(encoders.size(), 1u);
  const Encoder* const kept = &encoders.use(EncoderKind::x264, moving, make);
  fails = true;
  EXPECT_THROW(encoders.use(EncoderKind::x264, still, make), std::runtime_error);
  EXPECT_EQ(&encoders.use(EncoderKind::x264, moving, make), kept);
}

TEST(PoolExecutor, AClientThatNeverOpenedAStreamClosesIt) {
  PoolExecutor executor(std::make_shared<ThreadPool>(2));
  for (int i = 0; i < 100; ++i) executor.close(std::make_shared<Stream>());
}

}  // namespace
}  // namespace catgs
