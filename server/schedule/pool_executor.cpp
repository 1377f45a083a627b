#include "server/schedule/pool_executor.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "render_core/frame/device_error.h"

namespace catgs {
namespace {

bool lost(RenderStatus::Code code) { return code == RenderStatus::Code::device_failed; }

StreamOpened open_now(Stream& stream, StreamSettings settings, const EncoderFactory& encoders) {
  StreamOpened opened;
  try {
    if (!stream.view || stream.settings.renderer != settings.renderer) {
      stream.view.reset();  // its memory first: two views of a large scene may not fit
      stream.view = settings.renderer->make_view({.pipeline = Pipeline::catgs,
                                                  .format = PixelFormat::i420,
                                                  .speculation = following_speculation});
    }
  } catch (const DeviceError& error) {
    opened.message = error.what();
    opened.fault = lost(error.status_code()) ? Fault::device_failed : Fault::other;
    return opened;
  } catch (const std::exception& error) {
    opened.message = error.what();
    opened.fault = Fault::other;
    return opened;
  }
  try {
    const Encoder& encoder = stream.encoders.use(settings.encoder, settings.encoding, encoders);
    opened.codec = encoder.codec();
    opened.codec_string = encoder.codec_string();
    opened.encoder_name = encoder.name();
  } catch (const std::exception& error) {
    opened.message = error.what();
    opened.fault = Fault::encoder_unavailable;
    return opened;
  }
  stream.picture = {};
  stream.settings = std::move(settings);
  opened.ok = true;
  opened.device = stream.view->device();
  return opened;
}

/// False: rendering failed, and `result` says why.
bool render_now(FrameJob& job, FrameResult& result) {
  FrameTicket& ticket = result.frame.ticket;
  ticket = job.ticket;
  const TimePoint start = Clock::now();
  if (!ticket.refined) {
    Stream& stream = *job.stream;
    const RenderStatus rendered = stream.view->render(job.request, stream.picture);
    if (!rendered.ok()) {
      result.message = rendered.message;
      result.fault = Fault::other;
      if (lost(rendered.code)) {  // its buffers are lost
        result.fault = Fault::device_failed;
        stream.picture = {};
        stream.view.reset();
      }
      return false;
    }
    result.stats = stream.picture.stats;
    const DepthGrid& grid = stream.picture.depths;
    stream.depths.reset();
    if (grid.cells.x > 0) stream.depths = std::make_shared<const PackedDepths>(pack(grid));
  }
  result.frame.depths = job.stream->depths;
  ticket.render = {start, Clock::now()};
  return true;
}

/// Null: the encoder cannot be opened, and `result` says why.
Encoder* encoder_for(const FrameJob& job, const EncoderFactory& encoders, FrameResult& result) {
  try {
    return &job.stream->encoders.use(job.stream->settings.encoder, job.encoding, encoders);
  } catch (const std::exception& error) {
    result.message = error.what();
    result.fault = Fault::encoder_unavailable;
    return nullptr;
  }
}

void encode_now(FrameJob& job, const EncoderFactory& encoders, FrameResult& result) {
  FrameTicket& ticket = result.frame.ticket;
  EncodedFrame encoded;
  const TimePoint start = Clock::now();
  Encoder* const encoder = encoder_for(job, encoders, result);
  if (!encoder) return;
  const auto& depths = result.frame.depths;
  const std::size_t depth_bits = depths ? 8 * depths->codes.size() : 0;
  const int depth_kbps = static_cast<int>(depth_bits) * job.real_fps / 1000;
  encoder->set_rate(std::max(min_bitrate_kbps, job.bitrate_kbps - depth_kbps), job.real_fps);
  const EncodeStatus status = encoder->encode(job.stream->picture, job.force_idr, encoded);
  ticket.encode = {start, Clock::now()};
  if (!status.ok) {
    result.message = status.message;
    result.fault = Fault::encoder_failed;
    job.stream->encoders.drop_last();
    return;
  }
  ticket.codec = encoder->codec();
  ticket.idr = encoded.idr;
  result.codec_string = encoder->codec_string();
  result.sharp = encoded.sharp;
  result.frame.bitstream = std::move(encoded.bytes);
  result.ok = true;
}

}  // namespace

// A worker releases the stream before it reports. The stream may hold the last reference to this
// very pool, which its own threads cannot join. For the same reason the executor, which owns the
// pools, outlives the streams that are closing.

PoolExecutor::PoolExecutor(Pools pools, EncoderFactory encoders)
    : pools_(std::move(pools)), encoders_(std::move(encoders)) {}

PoolExecutor::~PoolExecutor() {
  std::unique_lock lock(mutex_);
  closed_.wait(lock, [this] { return closing_ == 0; });
}

int PoolExecutor::slots() const {
  int threads = pools_.encode->threads();
  for (const auto& [device, pool] : pools_.render) threads += pool->threads();
  return threads;
}

/// The pool that renders frames of this View; null: the encoding pool.
ThreadPool* PoolExecutor::render_pool(const View& view) const {
  const std::optional<int> device = view.device();
  const auto found = device ? pools_.render.find(*device) : pools_.render.end();
  return found == pools_.render.end() ? nullptr : found->second.get();
}

void PoolExecutor::open(std::shared_ptr<Stream> stream, StreamSettings settings,
                        std::function<void(StreamOpened)> done) {
  pools_.encode->submit([encoders = encoders_, stream = std::move(stream),
                         settings = std::move(settings), done = std::move(done)]() mutable {
    StreamOpened opened = open_now(*stream, std::move(settings), encoders);
    stream.reset();
    done(std::move(opened));
  });
}

void PoolExecutor::close(std::shared_ptr<Stream> stream) {
  {
    const std::lock_guard lock(mutex_);
    ++closing_;
  }
  pools_.encode->submit([this, stream = std::move(stream)]() mutable {
    stream.reset();
    const std::lock_guard lock(mutex_);
    --closing_;
    closed_.notify_all();  // under the lock: the executor may end right after it
  });
}

void PoolExecutor::submit(FrameJob job, std::function<void(FrameResult)> done) {
  struct Work {
    FrameJob job;
    FrameResult result;
    std::function<void(FrameResult)> done;

    void report() {
      job.stream.reset();
      done(std::move(result));
    }
  };
  ThreadPool* const encode = pools_.encode.get();
  ThreadPool* const render = render_pool(*job.stream->view);
  auto work = std::make_shared<Work>(Work{std::move(job), {}, std::move(done)});
  ThreadPool* const first = render ? render : encode;
  first->submit([encode, first, encoders = encoders_, work = std::move(work)]() mutable {
    const bool rendered = render_now(work->job, work->result);
    const auto finish = [rendered, encoders](Work& w) {
      if (rendered) encode_now(w.job, encoders, w.result);
      w.report();
    };
    if (first == encode || !rendered) return finish(*work);
    encode->submit([work = std::move(work), finish]() { finish(*work); });
  });
}

}  // namespace catgs
