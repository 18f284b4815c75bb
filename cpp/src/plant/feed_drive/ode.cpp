#include "plant/feed_drive/ode.hpp"

#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <new>
#include <string>
#include <type_traits>
#include <utility>

#include <cvode/cvode.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::VectorXd;

constexpr long max_steps_per_advance = 1'000'000;
constexpr double no_stop = std::numeric_limits<double>::max();
constexpr int recoverable = 1;
constexpr int unrecoverable = -1;

// One owner per SUNDIALS object; each is freed by its own function.
struct FreeContext {
  void operator()(SUNContext context) const noexcept { SUNContext_Free(&context); }
};
struct FreeVector {
  void operator()(N_Vector vector) const noexcept { N_VDestroy(vector); }
};
struct FreeMatrix {
  void operator()(SUNMatrix matrix) const noexcept { SUNMatDestroy(matrix); }
};
struct FreeSolver {
  void operator()(SUNLinearSolver solver) const noexcept { SUNLinSolFree(solver); }
};
struct FreeCvode {
  void operator()(void* memory) const noexcept { CVodeFree(&memory); }
};
using Context = std::unique_ptr<std::remove_pointer_t<SUNContext>, FreeContext>;
using Vector = std::unique_ptr<std::remove_pointer_t<N_Vector>, FreeVector>;
using Matrix = std::unique_ptr<std::remove_pointer_t<SUNMatrix>, FreeMatrix>;
using LinearSolver = std::unique_ptr<std::remove_pointer_t<SUNLinearSolver>, FreeSolver>;
using Cvode = std::unique_ptr<void, FreeCvode>;

std::string flag_name(int flag) {
  const std::unique_ptr<char, decltype(&std::free)> name(CVodeGetReturnFlagName(flag), &std::free);
  return name ? name.get() : std::to_string(flag);
}

/// Keeps CVODE's own words out of stderr: they are in the Error.
void keep_silent(int, const char*, const char*, char*, void*) {}

Eigen::Map<VectorXd> map_of(N_Vector vector) { return {N_VGetArrayPointer(vector), N_VGetLength(vector)}; }

/// Two functions as a system.
class FunctionSystem final : public OdeSystem {
 public:
  FunctionSystem(OdeSolver::Rhs rhs, OdeSolver::Jacobian jacobian, Eigen::Index size)
      : rhs_(std::move(rhs)), jacobian_(std::move(jacobian)), size_(size) {
    if (!rhs_ || !jacobian_) {
      throw Error(ErrorKind::argument, "an initial value problem needs a right side and a Jacobian");
    }
  }
  void rate(double t, const double* y, double* rate) override {
    Eigen::Map<VectorXd> result(rate, size_);
    rhs_(t, Eigen::Map<const VectorXd>(y, size_), result);
  }
  void jacobian(double t, const double* y, double* matrix) override {
    Eigen::Map<Eigen::MatrixXd> result(matrix, size_, size_);
    jacobian_(t, Eigen::Map<const VectorXd>(y, size_), result);
  }

 private:
  OdeSolver::Rhs rhs_;
  OdeSolver::Jacobian jacobian_;
  Eigen::Index size_;
};

}  // namespace

void OdeSystem::magnitudes(double, const double* y, Eigen::Ref<VectorXd> magnitude) {
  magnitude = Eigen::Map<const VectorXd>(y, magnitude.size()).cwiseAbs();
}

struct OdeSolver::Impl {
  std::unique_ptr<FunctionSystem> functions;  // null: the system is another's
  OdeSystem* system = nullptr;
  VectorXd state;
  double rtol = 0.0;
  VectorXd atol;
  double time = 0.0;
  bool failed = false;
  long steps_before_restart = 0;
  long evaluations = 0;
  std::exception_ptr thrown;  // by the system, kept while C code is on the stack

  // Freed in reverse order: the context last.
  Context context;
  Vector y;
  Matrix matrix;
  LinearSolver linear_solver;
  Cvode cvode;

  void open(const VectorXd& y0, double t0, double relative, const VectorXd& absolute);
  static int call_rhs(realtype t, N_Vector y, N_Vector rate, void* self) noexcept;
  static int call_jacobian(realtype t, N_Vector y, N_Vector rate, SUNMatrix jacobian, void* self, N_Vector, N_Vector,
                           N_Vector) noexcept;
  static int call_weights(N_Vector y, N_Vector weights, void* self) noexcept;

  void check(int flag, const char* call) {
    if (flag >= 0) return;
    failed = true;
    if (thrown) std::rethrow_exception(std::exchange(thrown, nullptr));
    double reached = time;
    if (cvode) CVodeGetCurrentTime(cvode.get(), &reached);
    throw Error(ErrorKind::numeric, fmt::format("{} failed with {} at t = {} s", call, flag_name(flag), reached));
  }
  [[nodiscard]] long steps_since_restart() const noexcept {
    long count = 0;
    CVodeGetNumSteps(cvode.get(), &count);
    return count;
  }
};

int OdeSolver::Impl::call_rhs(realtype t, N_Vector y, N_Vector rate, void* self_pointer) noexcept {
  auto& self = *static_cast<Impl*>(self_pointer);
  try {
    ++self.evaluations;
    self.system->rate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rate));
    return map_of(rate).allFinite() ? 0 : recoverable;
  } catch (...) {
    self.thrown = std::current_exception();
    return unrecoverable;
  }
}

// CVODE's own form.  NOLINTNEXTLINE(readability-function-size)
int OdeSolver::Impl::call_jacobian(realtype t, N_Vector y, N_Vector, SUNMatrix jacobian, void* self_pointer, N_Vector,
                                   N_Vector, N_Vector) noexcept {
  auto& self = *static_cast<Impl*>(self_pointer);
  try {
    Eigen::Map<Eigen::MatrixXd> result(SUNDenseMatrix_Data(jacobian), SUNDenseMatrix_Rows(jacobian),
                                       SUNDenseMatrix_Columns(jacobian));
    result.setZero();
    self.system->jacobian(t, N_VGetArrayPointer(y), result.data());
    return result.allFinite() ? 0 : recoverable;
  } catch (...) {
    self.thrown = std::current_exception();
    return unrecoverable;
  }
}

int OdeSolver::Impl::call_weights(N_Vector y, N_Vector weights, void* self_pointer) noexcept {
  auto& self = *static_cast<Impl*>(self_pointer);
  try {
    double t = self.time;
    CVodeGetCurrentTime(self.cvode.get(), &t);
    Eigen::Map<VectorXd> weight = map_of(weights);
    self.system->magnitudes(t, N_VGetArrayPointer(y), weight);
    weight = (self.rtol * weight + self.atol).cwiseInverse();
    return weight.allFinite() ? 0 : unrecoverable;
  } catch (...) {
    self.thrown = std::current_exception();
    return unrecoverable;
  }
}

OdeSolver::OdeSolver(Rhs rhs, Jacobian jacobian, const VectorXd& y0, double t0, double rtol, double atol)
    : OdeSolver(std::move(rhs), std::move(jacobian), y0, t0, rtol, VectorXd(VectorXd::Constant(y0.size(), atol))) {}

OdeSolver::OdeSolver(Rhs rhs, Jacobian jacobian, const VectorXd& y0, double t0, double rtol, const VectorXd& atol)
    : impl_(std::make_unique<Impl>()) {
  impl_->functions = std::make_unique<FunctionSystem>(std::move(rhs), std::move(jacobian), y0.size());
  impl_->system = impl_->functions.get();
  impl_->open(y0, t0, rtol, atol);
}

OdeSolver::OdeSolver(OdeSystem& system, const VectorXd& y0, double t0, double rtol, const VectorXd& atol)
    : impl_(std::make_unique<Impl>()) {
  impl_->system = &system;
  impl_->open(y0, t0, rtol, atol);
}

void OdeSolver::Impl::open(const VectorXd& y0, double t0, double relative, const VectorXd& absolute) {
  if (y0.size() == 0 || !y0.allFinite() || !std::isfinite(t0)) {
    throw Error(ErrorKind::argument, fmt::format("initial state of {} values must be finite and not empty", y0.size()));
  }
  if (!std::isfinite(relative) || !(relative > 0.0)) {
    throw Error(ErrorKind::argument, fmt::format("relative tolerance {} must be above 0", relative));
  }
  if (absolute.size() != y0.size() || !absolute.allFinite() || !(absolute.minCoeff() >= 0.0)) {
    throw Error(ErrorKind::argument, "absolute tolerances must be one per unknown, finite and not below 0");
  }
  state = y0;
  time = t0;
  rtol = relative;
  atol = absolute;

  SUNContext created = nullptr;
  check(SUNContext_Create(nullptr, &created), "SUNContext_Create");
  context.reset(created);
  const auto size = static_cast<sunindextype>(y0.size());
  y.reset(N_VNew_Serial(size, created));
  matrix.reset(SUNDenseMatrix(size, size, created));
  cvode.reset(CVodeCreate(CV_BDF, created));
  if (!y || !matrix || !cvode) throw std::bad_alloc();
  linear_solver.reset(SUNLinSol_Dense(y.get(), matrix.get(), created));
  if (!linear_solver) throw std::bad_alloc();

  map_of(y.get()) = y0;
  void* const memory = cvode.get();
  check(CVodeSetErrHandlerFn(memory, keep_silent, nullptr), "CVodeSetErrHandlerFn");
  check(CVodeInit(memory, &Impl::call_rhs, t0, y.get()), "CVodeInit");
  check(CVodeSetUserData(memory, this), "CVodeSetUserData");
  check(CVodeWFtolerances(memory, &Impl::call_weights), "CVodeWFtolerances");
  check(CVodeSetLinearSolver(memory, linear_solver.get(), matrix.get()), "CVodeSetLinearSolver");
  check(CVodeSetJacFn(memory, &Impl::call_jacobian), "CVodeSetJacFn");
  check(CVodeSetMaxNumSteps(memory, max_steps_per_advance), "CVodeSetMaxNumSteps");
}

OdeSolver::~OdeSolver() = default;
OdeSolver::OdeSolver(OdeSolver&&) noexcept = default;
OdeSolver& OdeSolver::operator=(OdeSolver&&) noexcept = default;

const VectorXd& OdeSolver::advance(double t, bool stop_exactly) {
  Impl& self = *impl_;
  if (self.failed) {
    throw Error(ErrorKind::numeric, fmt::format("the solver failed at t = {} s; restart it first", self.time));
  }
  if (!(t >= self.time) || !std::isfinite(t)) {
    throw Error(ErrorKind::argument, fmt::format("cannot advance to t = {} s, the solver is at {} s", t, self.time));
  }
  if (t == self.time) return self.state;
  void* const cvode = self.cvode.get();
  double stepped_to = self.time;
  self.check(CVodeGetCurrentTime(cvode, &stepped_to), "CVodeGetCurrentTime");
  // If an earlier call stepped past t already, t is interpolated and nothing is left to stop. A stop that was reached
  // stays set in CVODE and would end the next call at once: so every call states its own.
  self.check(CVodeSetStopTime(cvode, stop_exactly && stepped_to < t ? t : no_stop), "CVodeSetStopTime");
  double reached = self.time;
  self.check(CVode(cvode, t, self.y.get(), &reached, CV_NORMAL), "CVode");
  self.state = map_of(self.y.get());
  self.time = t;
  return self.state;
}

void OdeSolver::restart(const VectorXd& y) { restart(y, impl_->time); }

void OdeSolver::restart(const VectorXd& y, double t) {
  Impl& self = *impl_;
  if (y.size() != self.state.size() || !y.allFinite() || !std::isfinite(t)) {
    throw Error(ErrorKind::argument,
                fmt::format("restart needs {} finite values, got {}", self.state.size(), y.size()));
  }
  void* const cvode = self.cvode.get();
  self.steps_before_restart += self.steps_since_restart();
  self.state = y;
  self.time = t;
  self.thrown = nullptr;
  map_of(self.y.get()) = y;
  self.check(CVodeReInit(cvode, t, self.y.get()), "CVodeReInit");
  self.failed = false;
}

void OdeSolver::limit_step(double longest) {
  require_above_zero(longest, "longest step", "s");
  impl_->check(CVodeSetMaxStep(impl_->cvode.get(), longest), "CVodeSetMaxStep");
}

double OdeSolver::time() const noexcept { return impl_->time; }
const VectorXd& OdeSolver::state() const noexcept { return impl_->state; }
long OdeSolver::steps() const noexcept { return impl_->steps_before_restart + impl_->steps_since_restart(); }
long OdeSolver::rhs_evaluations() const noexcept { return impl_->evaluations; }

}  // namespace shapegcode
