#include "server/schedule/pool_executor.h"

#include <exception>
#include <utility>

namespace catgs {
namespace {

StreamOpened open_now(Stream& stream, StreamSettings settings) {
  StreamOpened opened;
  try {
    if (!stream.view || stream.settings.renderer != settings.renderer) {
      stream.view.reset();  // its memory first: two views of a large scene may not fit
      stream.view = settings.renderer->make_view({Pipeline::catgs, PixelFormat::i420});
    }
    if (!stream.encoder || stream.settings.encoder != settings.encoder ||
        stream.settings.encoding != settings.encoding)
      stream.encoder = make_encoder(settings.encoder, settings.encoding);
  } catch (const std::exception& error) {
    opened.message = error.what();
    return opened;
  }
  stream.picture = {};
  stream.settings = std::move(settings);
  opened.ok = true;
  opened.codec = stream.encoder->codec();
  opened.codec_string = stream.encoder->codec_string();
  opened.encoder_name = stream.encoder->name();
  opened.device = stream.view->device();
  return opened;
}

FrameResult run_now(FrameJob& job) {
  FrameResult result;
  FrameTicket& ticket = result.frame.ticket;
  ticket = job.ticket;
  Stream& stream = *job.stream;
  ticket.render_start = Clock::now();
  if (!ticket.refined) {
    const RenderStatus rendered = stream.view->render(job.request, stream.picture);
    if (!rendered.ok()) {
      result.message = rendered.message;
      return result;
    }
    result.stats = stream.picture.stats;
    ticket.speculated = result.stats.kind == FrameKind::sub;
    ticket.window = static_cast<std::uint32_t>(result.stats.window);
  }
  ticket.render_end = Clock::now();
  EncodedFrame encoded;
  stream.encoder->set_rate(job.bitrate_kbps, job.real_fps);
  const EncodeStatus status = stream.encoder->encode(stream.picture, job.force_idr, encoded);
  ticket.encode_end = Clock::now();
  if (!status.ok) {
    result.message = status.message;
    return result;
  }
  ticket.codec = stream.encoder->codec();
  ticket.idr = encoded.idr;
  result.frame.bitstream = std::move(encoded.bytes);
  result.ok = true;
  return result;
}

}  // namespace

// A worker lets go of the stream before it reports: the stream may hold the last reference to this
// very pool, which none of its own threads can join. For the same reason the executor, which holds
// the pool, outlasts the streams that are closing.

PoolExecutor::~PoolExecutor() {
  std::unique_lock lock(mutex_);
  closed_.wait(lock, [this] { return closing_ == 0; });
}

void PoolExecutor::open(std::shared_ptr<Stream> stream, StreamSettings settings,
                        std::function<void(StreamOpened)> done) {
  pool_->submit([stream = std::move(stream), settings = std::move(settings),
                 done = std::move(done)]() mutable {
    StreamOpened opened = open_now(*stream, std::move(settings));
    stream.reset();
    done(std::move(opened));
  });
}

void PoolExecutor::close(std::shared_ptr<Stream> stream) {
  {
    const std::lock_guard lock(mutex_);
    ++closing_;
  }
  pool_->submit([this, stream = std::move(stream)]() mutable {
    stream.reset();
    const std::lock_guard lock(mutex_);
    --closing_;
    closed_.notify_all();  // under the lock: the executor may end right after it
  });
}

void PoolExecutor::submit(FrameJob job, std::function<void(FrameResult)> done) {
  pool_->submit([job = std::move(job), done = std::move(done)]() mutable {
    FrameResult result = run_now(job);
    job.stream.reset();
    done(std::move(result));
  });
}

}  // namespace catgs
